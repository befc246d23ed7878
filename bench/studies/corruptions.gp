# Accuracy and coverage against severity, means over seeds:
#   gnuplot -e "csv='bench/results/sensor_faults/corruptions.csv'; png='bench/results/sensor_faults/corruptions.png'" bench/studies/corruptions.gp
set terminal pngcairo size 1300,900 font "sans,10"
set output png
set datafile separator ","
set datafile commentschars "#"
set datafile missing NaN
set xrange [-0.2:5.2]
set yrange [0:1.02]
set grid
set key off
names = "noise drift gain stuck dead saturated jitter lost speed tilt swapped creep"
array models[3] = ["tiny", "paper", "four of paper"]
array colour[3] = ["#8a8a8a", "#1f5fa8", "#d2691e"]
pick(model, name) = strcol(1) eq model && (strcol(3) eq name || strcol(3) eq "none") ? column(4) : NaN
set multiplot layout 4,3 title "Contact SSIM (solid) and share of pixels that 90 % intervals hold (dashed) against severity; \
tiny grey, paper blue, four of paper averaged orange" margins 0.04,0.99,0.05,0.92 spacing 0.035,0.06
do for [name in names] {
  set title name offset 0,-0.6
  plot for [i = 1:3] csv skip 1 using (pick(models[i], name)):6 smooth unique with linespoints lw 2 pt 7 ps 0.6 lc rgb colour[i], \
       for [i = 1:3] csv skip 1 using (pick(models[i], name)):9 smooth unique with lines dt 2 lw 1.3 lc rgb colour[i]
}
unset multiplot
