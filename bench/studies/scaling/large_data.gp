# gnuplot -e "csv='results/large_data.csv'; out='results/charts/large_data.png'" large_data.gp
# What a training costs as its recordings grow: time to the first step, memory, and processor time of a step.
set datafile separator ','
set terminal pngcairo size 1200,400 font 'sans,10'
set output out
set multiplot layout 1,3
set logscale xy
set xlabel 'recorded frames'
set format x '10^{%T}'
set xrange [5e4:2e8]
set key top left
set grid
rows(mode) = sprintf("< grep ',%s,' %s", mode, csv)
set title 'until the first step'
set ylabel 's'
set yrange [0.05:2e3]
plot rows('held,all') using 1:6 with linespoints lc rgb '#e76f51' pt 7 title 'all held in memory', \
     rows('first') using 1:6 with linespoints lc rgb '#e9c46a' pt 5 title '--memory, first time', \
     rows('read') using 1:6 with linespoints lc rgb '#2a9d8f' pt 9 title '--memory, later'
set title 'most memory held'
set ylabel 'MB'
set yrange [10:2e4]
plot rows('held') using 1:8 with linespoints lc rgb '#e76f51' pt 7 title 'all held in memory', \
     rows('read') using 1:8 with linespoints lc rgb '#2a9d8f' pt 9 title '--memory'
unset logscale y
set title 'processor time of a step'
set ylabel 'ms'
set yrange [0:60]
plot rows('held') using 1:11 with points lc rgb '#e76f51' pt 7 title 'all held in memory', \
     rows('read') using 1:11 with points lc rgb '#2a9d8f' pt 9 title '--memory'
unset multiplot
