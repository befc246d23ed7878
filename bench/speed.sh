#!/bin/sh
# All figures of speed, on this machine, in about three minutes:
#   bench/speed.sh MODEL [BIN_DIR [RECORDINGS NAME=MODEL ...]]
# MODEL: of preset paper; BIN_DIR: a build with -DSUPERTAC_BENCH=ON; with recordings and named models ("paper 0=FILE") also
# their accuracy against their time, in both precisions. PEERS_PYTHON: the python of a virtual environment with
# bench/peers/requirements.txt. Writes bench/results/{peers,streaming,linear_cost,precision}.csv, their charts, the tables
# made from them and README's. Nothing else should run.
set -eu
cd "$(dirname "$0")/.."
model="$1"
bin="${2:-build-dev/bin}"
shift $(($# < 2 ? $# : 2))
results=bench/results
"${PEERS_PYTHON:-/usr/bin/python3}" bench/peers/compare.py "$model" --bin "$bin" --out $results/peers.csv
gnuplot -e "csv='$results/peers.csv'; png='$results/charts/peers.png'" bench/peers/chart.gp
"$bin/linear_cost" > $results/new.csv && mv $results/new.csv $results/linear_cost.csv
gnuplot -e "csv='$results/linear_cost.csv'; png='$results/charts/linear_cost.png'" bench/linear_cost.gp
"$bin/streaming" "$model" 60 > $results/new.csv && mv $results/new.csv $results/streaming.csv
if [ $# -ge 2 ]; then
  recordings="$1"
  shift
  bench/studies/precision.py "$bin" "$recordings" $results/precision.csv "$@"
  gnuplot -e "csv='$results/precision.csv'; png='$results/charts/precision.png'" bench/studies/precision.gp
fi
bench/results.py
