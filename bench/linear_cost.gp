# gnuplot -e "csv='bench/results/linear_cost.csv'; png='bench/results/charts/linear_cost.png'" bench/linear_cost.gp
set datafile separator ","
set terminal pngcairo size 1000,720 font ",11"
set output png
set grid
set key top left
rows(axis) = "< grep '^" . axis . "," . "' " . csv
set multiplot layout 2,2
set xrange [0:*]
set yrange [0:*]

stats rows("timesteps") using 2:4 name "T" nooutput
set title "window length"
set xlabel "T, samples"
set ylabel "us per window, batch 1"
plot rows("timesteps") using 2:4 with points pt 7 lc rgb "#4477aa" title "measured", \
     T_slope * x + T_intercept lc rgb "#ee6677" title sprintf("%.1f us + %.4f us per sample (r = %.4f)", T_intercept, T_slope, T_correlation)

stats rows("batch") using 2:4 name "B" nooutput
set title "batch"
set xlabel "windows in a batch"
set ylabel "us per batch"
plot rows("batch") using 2:4 with points pt 7 lc rgb "#4477aa" title "measured", \
     B_slope * x + B_intercept lc rgb "#ee6677" title sprintf("%.1f us per window (r = %.4f)", B_slope, B_correlation)

stats rows("channels") using 3:4 name "C" nooutput
set title "width: a convolution's weights grow with the square of the channels"
set xlabel "MMAC per window (8 to 96 channels)"
set ylabel "us per window, batch 1"
plot rows("channels") using 3:4 with points pt 7 lc rgb "#4477aa" title "measured", \
     rows("channels") using 3:4:2 with labels offset 0,-1 font ",8" notitle, \
     C_slope * x + C_intercept lc rgb "#ee6677" title sprintf("%.2f us per MMAC (r = %.4f)", C_slope, C_correlation)

stats rows("training_windows") using 2:($4 * 1e-6) name "N" nooutput
set title "training: one epoch, one thread"
set xlabel "windows in the data set"
set ylabel "s"
plot rows("training_windows") using 2:($4 * 1e-6) with points pt 7 lc rgb "#4477aa" title "measured", \
     N_slope * x + N_intercept lc rgb "#ee6677" title sprintf("%.3f ms per window (r = %.4f)", 1e3 * N_slope, N_correlation)
unset multiplot
