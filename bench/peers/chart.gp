# gnuplot -e "csv='bench/results/peers.csv'; png='bench/results/peers.png'" bench/peers/chart.gp
set datafile separator ","
set terminal pngcairo size 900,420 font ",11"
set output png
eager = "< grep 'pytorch eager' " . csv
set multiplot layout 1,2
set style fill solid 0.9 border lt -1
set grid ytics
set xtics nomirror
set xrange [-0.6:3.6]
set title "speed, PyTorch eager = 1 (bars: 95 % interval)"
set yrange [0:*]
unset key
plot eager using 0:6:(0.6):xtic(1) with boxes lc rgb "#4477aa", \
     eager using 0:6:7:8 with yerrorbars lc rgb "black" pt 7 ps 0.4
set title "share of the measured FMA peak, one thread"
set yrange [0:1]
set key top right
plot eager using ($0 - 0.2):10:(0.38):xtic(1) with boxes lc rgb "#4477aa" title "SuperTac", \
     eager using ($0 + 0.2):11:(0.38) with boxes lc rgb "#ee6677" title "PyTorch eager"
unset multiplot
