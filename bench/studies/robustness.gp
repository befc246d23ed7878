# gnuplot -e "csv='results/robustness_real.csv'; out='results/robustness_real.png'" robustness.gp
# SSIM in contact against each disturbance.
set datafile separator ','
set terminal pngcairo size 1200,700 font 'sans,10'
set output out
set multiplot layout 2,3
set yrange [-0.05:1]
set ylabel 'SSIM in contact'
set key top right
labels = 'noise:noise_(share_of_the_range) dead:dead_taxels lost:lost_frames_(share) speed:speed_(mm/s) pitch:pitch_(mm)'
do for [entry in labels] {
  colon = strstrt(entry, ':')
  name = entry[1:colon-1]
  text = entry[colon+1:]
  pick(method) = sprintf("< grep '^%s,' %s | grep ',%s,'", name, csv, method)
  if (system(sprintf("grep -c '^%s,' %s || true", name, csv)) + 0 > 0) {
    set xlabel system(sprintf("echo '%s' | tr _ ' '", text))
    plot pick('network') using 2:5 with linespoints pt 7 lc rgb '#2a9d8f' title 'network', \
         pick('bicubic') using 2:5 with linespoints pt 6 lc rgb '#e76f51' title 'bicubic', \
         pick('mean_image') using 2:5 with lines dt 2 lc rgb '#555555' title 'mean image'
  }
}
unset multiplot
