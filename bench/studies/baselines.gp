# Accuracy against cost: gnuplot -e "csv='bench/results/baselines.csv'; png='bench/results/charts/baselines.png'" bench/studies/baselines.gp
set terminal pngcairo size 1100,640 font "sans,11"
set output png
set datafile separator ","
set key off
set logscale x
set grid
set xlabel "processor time of one picture, one thread (us)"
set ylabel "SSIM in contact, unseen trial (mean of five seeds, 95 % interval)"
set title "Accuracy against cost; the line joins those that nothing cheaper equals"
set yrange [-0.15:1.2]
set xrange [0.1:*]
set offsets graph 0, graph 0.25, 0, 0
front(y, is) = is == 1 ? y : NaN
set datafile missing NaN
plot csv skip 1 using 9:(front($3, $10)) with lines lw 2 lc rgb "#888888", \
     "" skip 1 using 9:3:4 with yerrorbars pt 7 ps 1.1 lc rgb "#1f5fa8", \
     "" skip 1 every 2 using 9:3:1 with labels left rotate by 35 offset 0.4,0.8 font "sans,9", \
     "" skip 1 every 2::1 using 9:3:1 with labels left rotate by -35 offset 0.4,-0.8 font "sans,9"
