# gnuplot -e "csv='results/stability_map.csv'; out='results/charts/stability_map.png'" stability_map.gp
# Rows: beta; columns: learning rate; a panel with and one without safeguards. A cell tells its seeds' outcomes.
set datafile separator ','
set terminal pngcairo size 1100,420 font 'sans,10'
set output out
set multiplot layout 1,2
set logscale xy
set xlabel 'learning rate'
set ylabel 'beta'
set xrange [5e-4:0.2]
set yrange [3e-4:3]
set format xy '10^{%T}'
set key outside bottom center horizontal
set bmargin 6  # room for the key under the axis' name
shift(seed) = 10**(0.07 * (seed - 2))
do for [mode in 'on off'] {
  set title (mode eq 'on' ? 'clipped at 1, 5 % warm-up' : 'neither clipping nor warm-up')
  pick(outcome) = sprintf("< grep '^%s,' %s | grep ',%s,'", mode, csv, outcome)
  plot pick('trained') using ($2*shift($4)):3 with points pt 7 ps 1.2 lc rgb '#2a9d8f' title 'trained', \
       pick('slow') using ($2*shift($4)):3 with points pt 6 ps 1.2 lc rgb '#8ab17d' title 'slow', \
       pick('collapsed') using ($2*shift($4)):3 with points pt 13 ps 1.4 lc rgb '#e9c46a' title 'collapsed', \
       pick('diverged') using ($2*shift($4)):3 with points pt 9 ps 1.3 lc rgb '#e76f51' title 'diverged', \
       pick('stopped') using ($2*shift($4)):3 with points pt 2 ps 1.1 lc rgb '#9b2226' title 'stopped', \
       1e-30 notitle
}
unset multiplot
