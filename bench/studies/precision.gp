# gnuplot -e "csv='bench/results/speed/precision.csv'; png='bench/results/speed/precision.png'" bench/studies/precision.gp
set terminal pngcairo size 1000,560 font "sans,11"
set output png
set datafile separator ","
set datafile missing NaN
set logscale x
set grid
set key bottom right
set xrange [0.1:2000]
set yrange [-0.05:1]
set xlabel "time of one picture, one thread (us)"
set ylabel "contact SSIM, unseen trial"
set title "Accuracy against time, each seed"
# A name that ends with a number above 0 is another seed of the one before.
first(name) = strstrt("123456789", name[strlen(name):strlen(name)]) == 0 ? name : ""
label(name) = first(name) eq "" ? "" : name[strlen(name) - 1:] eq " 0" ? name[:strlen(name) - 2] : name
plot csv skip 1 using 5:(strcol(2) eq "fp32" ? $3 : NaN) with points pt 7 ps 1.2 lc rgb "#1f5fa8" notitle, \
     "" skip 1 using 5:(strcol(2) eq "fp32" && label(strcol(1)) ne "" ? $3 : NaN):(label(strcol(1))) with labels left offset 0.8,0.8 font "sans,10" notitle
