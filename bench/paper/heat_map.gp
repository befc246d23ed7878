# Read by figure8.py, which sets the output, the tics and $cells: column, row, SSIM.
set terminal pngcairo size 620,300 font "sans,11"
set xlabel "T, samples of a window"
set ylabel "LD, numbers of a latent"
set cblabel "contact SSIM"
set palette defined (0 "#1b2a52", 0.5 "#2f8f83", 1 "#f3efb0")
set tics scale 0
set xrange [-0.5:4.5]
set yrange [-0.5:2.5]
unset key
stats $cells using 3 nooutput
middle = (STATS_min + STATS_max) / 2
plot $cells using 1:2:(0.5):(0.5):3 with boxxyerror fill solid noborder linecolor palette, \
     $cells using 1:2:($3 > middle ? sprintf("%.3f", $3) : "") with labels textcolor rgb "black", \
     $cells using 1:2:($3 > middle ? "" : sprintf("%.3f", $3)) with labels textcolor rgb "white"
