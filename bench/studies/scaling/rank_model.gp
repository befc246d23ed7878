# gnuplot -e "model='results/rank_model.csv'; accuracy='results/large_batches.csv'; out='results/charts/rank_model.png'" rank_model.gp
# Left: the batch for which R processes are 80 % as efficient as one. Right: what large batches cost in accuracy.
set datafile separator ','
set terminal pngcairo size 1000,400 font 'sans,10'
set output out
set multiplot layout 1,2
set grid
set logscale xy 2
set key top left
set title 'batch that keeps R processes 80 % efficient (preset paper)'
set xlabel 'processes R, each on a machine of its own'
set ylabel 'windows in a batch'
rows(link) = sprintf("< grep -E '^80 .* efficient,[0-9]+,[0-9]+,%d,' %s", link, model)
set arrow from graph 0, first 1024 to graph 1, first 1024 nohead dt 2 lc rgb '#888888'
set label 'measured up to here' at graph 0.98, first 1300 right tc rgb '#888888'
plot rows(1000) using 2:3 with linespoints lc rgb '#e76f51' pt 7 title '1 Gbit/s', \
     rows(10000) using 2:3 with linespoints lc rgb '#e9c46a' pt 5 title '10 Gbit/s', \
     rows(100000) using 2:3 with linespoints lc rgb '#2a9d8f' pt 9 title '100 Gbit/s'
unset arrow
unset label
unset logscale y
set key bottom left
set title 'accuracy of such batches (preset tiny, unseen trial, five seeds)'
set xlabel 'windows in a batch'
set ylabel 'contact SSIM'
set xrange [48:1400]
of(rule) = sprintf("< grep -E '^(64,usual|[0-9]+,%s)' %s", rule, accuracy)
plot of('usual') using 1:5 with points lc rgb '#e76f51' pt 6 notitle, \
     of('usual') using 1:5 smooth unique with lines lc rgb '#e76f51' title 'learning rate of the preset', \
     of('root') using 1:5 with points lc rgb '#2a9d8f' pt 4 notitle, \
     of('root') using 1:5 smooth unique with lines lc rgb '#2a9d8f' title 'rate grows with the root of the batch'
unset multiplot
