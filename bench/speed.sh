#!/bin/sh
# The figures of speed, on this machine, in about three minutes:
#   bench/speed.sh MODEL [BIN_DIR [RECORDINGS NAME=MODEL ...]]
# MODEL: of preset paper; BIN_DIR: a build with -DSUPERTAC_BENCH=ON; with recordings and named models ("paper 0=FILE") also
# their accuracy against their time, in both precisions. PEERS_PYTHON: the python of a virtual environment with
# bench/peers/requirements.txt. Writes bench/results/speed/{peers,precision}.csv, their charts, and the tables made from
# them. Nothing else should run.
set -eu
cd "$(dirname "$0")/.."
model="$1"
bin="${2:-build-dev/bin}"
shift $(($# < 2 ? $# : 2))
speed=bench/results/speed
"${PEERS_PYTHON:-/usr/bin/python3}" bench/peers/compare.py "$model" --bin "$bin" --out $speed/peers.csv
gnuplot -e "csv='$speed/peers.csv'; png='$speed/peers.png'" bench/peers/chart.gp
if [ $# -ge 2 ]; then
  recordings="$1"
  shift
  bench/studies/precision.py "$bin" "$recordings" $speed/precision.csv "$@"
  gnuplot -e "csv='$speed/precision.csv'; png='$speed/precision.png'" bench/studies/precision.gp
fi
bench/results.py
