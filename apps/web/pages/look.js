// What the scripts of all pages share.
"use strict";
const element = (id) => document.getElementById(id);
const bytes = (base64) => Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// A canvas of one dot for each level(row, column), 0 to 255; row 0 is at the top, and what is undefined is left out.
function paint(canvas, map, rows, columns, level) {
  canvas.width = columns;
  canvas.height = rows;
  const g = canvas.getContext("2d"), dots = g.createImageData(columns, rows);
  for (let r = 0, at = 0; r < rows; ++r)
    for (let c = 0; c < columns; ++c, at += 4) {
      const value = level(r, c);
      if (value === undefined) continue;
      for (let k = 0; k < 3; ++k) dots.data[at + k] = map[3 * value + k];
      dots.data[at + 3] = 255;
    }
  g.putImageData(dots, 0, 0);
  return canvas;
}
