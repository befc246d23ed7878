# gnuplot -e "csv='bench/results/precision.csv'; png='bench/results/charts/precision.png'" bench/studies/precision.gp
set terminal pngcairo size 800,480 font "sans,11"
set output png
set datafile separator ","
set datafile missing NaN
set logscale x
set grid
set key bottom right
set xrange [10:1000]
set yrange [0.84:0.9]
set xlabel "time of one picture, one thread (us)"
set ylabel "contact SSIM, unseen trial"
set title "Accuracy against time, each seed, in both precisions"
plot csv skip 1 using 5:(strcol(2) eq "fp32" ? $3 : NaN) with points pt 7 ps 1.2 lc rgb "#1f5fa8" title "fp32", \
     "" skip 1 using 5:(strcol(2) eq "int8" ? $3 : NaN) with points pt 5 ps 1.2 lc rgb "#d2691e" title "int8", \
     "" skip 1 using 5:(strstrt(strcol(1), " 0") > 0 && strcol(2) eq "fp32" ? $3 : NaN):(word(strcol(1), 1)) with labels left offset 1,0.3 font "sans,9" notitle
