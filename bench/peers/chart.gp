# gnuplot -e "csv='bench/results/speed/peers.csv'; png='bench/results/speed/peers.png'" bench/peers/chart.gp
set datafile separator ","
set terminal pngcairo size 900,520 font ",11"
set output png
set title "times as fast as each engine, one thread (bars: 95 % interval)"
set ylabel "engine's time / ours"
set style fill solid 0.9 border lt -1
set logscale y 2
set yrange [0.5:32]
set grid ytics
set xtics nomirror rotate by 45 right noenhanced
set key top right
set bmargin 11
set lmargin 12
measured = "< grep -v '^#\\|ours on one thread' " . csv
of(word) = strstrt(stringcolumn(1), word) == 1 ? column(6) : NaN
plot measured using 0:6:(0.6):xtic(stringcolumn(1) . ": " . stringcolumn(2)) every ::1 with boxes lc rgb "#bbbbbb" notitle, \
     measured using 0:(of("infer")):(0.6) every ::1 with boxes lc rgb "#4477aa" title "pictures", \
     measured using 0:(of("train")):(0.6) every ::1 with boxes lc rgb "#ccbb44" title "training", \
     measured using 0:6:7:8 every ::1 with yerrorbars lc rgb "black" pt 7 ps 0.4 notitle, \
     1 lc rgb "black" dt 2 notitle
