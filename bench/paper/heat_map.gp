# Read by figure8.py, which sets the output, the tics and $cells: column, row, SSIM.
set terminal pngcairo size 560,300 font "sans,11"
set xlabel "T, samples of a window"
set ylabel "LD, numbers of a latent"
set cblabel "contact SSIM"
set palette defined (0 "#1b2a52", 0.5 "#2f8f83", 1 "#f3efb0")
set tics scale 0
unset key
plot $cells using 1:2:3 with image, \
     $cells using 1:2:(sprintf("%.3f", $3)) with labels font "sans bold,11" textcolor rgb "white" offset 0.1,-0.1, \
     $cells using 1:2:(sprintf("%.3f", $3)) with labels font "sans bold,11" textcolor rgb "black"
