// How the live page draws its canvases; what it draws is in page.js, which follows.

// A canvas of as many dots as the screen has; sizes below are in CSS pixels.
function prepared(canvas) {
  const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
  if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
    canvas.width = Math.round(w * ratio);
    canvas.height = Math.round(h * ratio);
  }
  const g = canvas.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, w, h);
  return {g, w, h};
}

// levels [rows][columns], row 0 at the bottom, as an image of one dot each.
const scratch = document.createElement("canvas");
const image = (levels, rows, columns) =>
    paint(scratch, supertac.hello.colours, rows, columns, (r, c) => levels[(rows - 1 - r) * columns + c]);

function hatch(g, wide, rows, columns, box) {
  g.save();
  g.beginPath();
  const dx = box.w / columns, dy = box.h / rows;
  for (let i = 0; i < wide.length; ++i) {
    if (wide[i] <= GUESS) continue;
    g.rect(box.x + (i % columns) * dx, box.y + (rows - 1 - Math.floor(i / columns)) * dy, dx, dy);
  }
  g.clip();
  for (const [color, shift] of [["#0009", 0], ["#fff9", 1]]) {
    g.strokeStyle = color;
    g.lineWidth = 1;
    g.beginPath();
    for (let s = -box.h; s < box.w; s += 7) {
      g.moveTo(box.x + s + shift, box.y + box.h);
      g.lineTo(box.x + s + shift + box.h, box.y);
    }
    g.stroke();
  }
  g.restore();
}

// A picture with axes in mm from the finger's centre; a pixel is mmX by mmY. Returns where the picture lies.
function drawPicture(g, w, h, levels, rows, columns, [mmX, mmY], wide) {
  const left = 30, bottom = 32, top = 6, right = 6;
  const unit = Math.min((w - left - right) / (columns * mmX), (h - top - bottom) / (rows * mmY));
  const box = {x: left, y: top, w: unit * columns * mmX, h: unit * rows * mmY};
  g.imageSmoothingEnabled = false;
  if (levels) g.drawImage(image(levels, rows, columns), box.x, box.y, box.w, box.h);
  if (levels && wide) hatch(g, wide, rows, columns, box);
  g.strokeStyle = g.fillStyle = style("--quiet");
  g.lineWidth = 1;
  g.strokeRect(box.x - .5, box.y - .5, box.w + 1, box.h + 1);
  g.font = "11px system-ui, sans-serif";
  const longer = Math.max(rows * mmY, columns * mmX), step = [1, 2, 3, 5, 10, 20, 50].find((s) => longer / s <= 5) || 100;
  const ticks = (mm, draw) => { for (let v = -Math.floor(mm / 2 / step) * step; v <= mm / 2 + 1e-9; v += step) draw(v); };
  g.textAlign = "center";
  g.textBaseline = "top";
  ticks(columns * mmX, (v) => {
    const x = box.x + box.w / 2 + v * unit;
    g.fillRect(x - .5, box.y + box.h, 1, 4);
    g.fillText(v, x, box.y + box.h + 5);
  });
  g.fillText("x, mm", box.x + box.w / 2, box.y + box.h + 19);
  g.textAlign = "right";
  g.textBaseline = "middle";
  ticks(rows * mmY, (v) => {
    const y = box.y + box.h / 2 - v * unit;
    g.fillRect(box.x - 4, y - .5, 4, 1);
    g.fillText(v, box.x - 6, y);
  });
  g.save();
  g.translate(6, box.y + box.h / 2);
  g.rotate(-Math.PI / 2);
  g.textAlign = "center";
  g.fillText("y, mm", 0, 0);
  g.restore();
  return box;
}

// Over taxels that say nothing.
function cross(g, box, silent, rows, columns) {
  const dx = box.w / columns, dy = box.h / rows;
  g.strokeStyle = "#f33";
  g.lineWidth = 2;
  g.beginPath();
  for (const k of silent) {
    const x = box.x + (k % columns) * dx, y = box.y + (rows - 1 - Math.floor(k / columns)) * dy;
    g.moveTo(x, y);
    g.lineTo(x + dx, y + dy);
    g.moveTo(x, y + dy);
    g.lineTo(x + dx, y);
  }
  g.stroke();
}

// Round the place that is asked for; seen on every colour.
function ring(g, box, k, rows, columns) {
  const dx = box.w / columns, dy = box.h / rows, x = box.x + (k % columns) * dx, y = box.y + (rows - 1 - Math.floor(k / columns)) * dy;
  for (const [color, width] of [["#000", 6], ["#fff", 3]]) {
    g.strokeStyle = color;
    g.lineWidth = width;
    g.strokeRect(x + 3, y + 3, dx - 6, dy - 6);
  }
}

// The colours from 0 to 1 and what the ends mean.
function drawBar(g, w, [low, high], left = 30) {
  const colours = supertac.hello.colours, width = w - left - 6;
  for (let i = 0; i < 256; ++i) {
    g.fillStyle = `rgb(${colours[3 * i]},${colours[3 * i + 1]},${colours[3 * i + 2]})`;
    g.fillRect(left + width * i / 256, 0, width / 256 + 1, 12);
  }
  g.fillStyle = style("--quiet");
  g.font = "11px system-ui, sans-serif";
  g.textBaseline = "top";
  for (const [text, align, x] of [[low, "left", left], [high, "right", left + width]]) {
    g.textAlign = align;
    g.fillText(text, x, 16);
  }
}
const feltEnds = (event, w) =>
    ["at rest", event && event.felt ? `${event.top.toPrecision(3)} ${supertac.hello.unit}${w < 240 ? "" : " from rest"}` : ""];
const drawnEnds = (w) => w < 240 ? ["0", "highest"] : ["0", "1, the highest"];

// values [column][row] up to `top`, oldest first, the newest at the right edge.
function drawStrip(canvas, values, top, rows, labels, withTime) {
  const {g, w, h} = prepared(canvas), left = 30, bottom = withTime ? 18 : 0, height = h - bottom;
  paint(scratch, supertac.hello.colours, rows, COLUMNS, (r, c) => {
    const time = strips.end - COLUMNS + 1 + c, slot = (time % COLUMNS + COLUMNS) % COLUMNS;
    if (strips.times[slot] !== time) return undefined;
    return Math.min(255, Math.round(255 * values[slot * rows + rows - 1 - r] / top));
  });
  g.imageSmoothingEnabled = false;
  g.fillStyle = style("--well");
  g.fillRect(left, 0, w - left - 6, height);
  g.drawImage(scratch, left, 0, w - left - 6, height);
  g.fillStyle = style("--quiet");
  g.font = "11px system-ui, sans-serif";
  g.textAlign = "right";
  for (const [text, at] of labels) {
    g.textBaseline = at < .1 ? "bottom" : at > .9 ? "top" : "middle";
    g.fillText(text, left - 6, height * (1 - at));
  }
  if (!withTime) return;
  g.textBaseline = "top";
  for (let s = -HISTORY_S; s <= 0; s += 2) {
    const x = left + (w - left - 6) * (1 + s / HISTORY_S);
    g.textAlign = s === -HISTORY_S ? "left" : s === 0 ? "right" : "center";
    g.fillRect(Math.min(x, w - 7), height, 1, 3);
    g.fillText(s === 0 ? "now" : s + " s", x, height + 4);
  }
}

function drawMap() {
  if (element("slide").hidden || surface.size === 0) return;
  const canvas = element("map"), [mmX, mmY] = supertac.hello.pixel_mm, colours = supertac.hello.colours;
  const at = [...surface].map(([key, level]) => [...key.split(",").map(Number), level]);
  const ends = (k) => at.reduce(([low, high], one) => [Math.min(low, one[k]), Math.max(high, one[k] + 1)], [Infinity, -Infinity]);
  const [x0, x1] = ends(0), [y0, y1] = ends(1), left = 34, bottom = 32;
  const unit = Math.min((canvas.clientWidth - left - 6) / ((y1 - y0) * mmY), 160 / ((x1 - x0) * mmX));  // dots a mm
  canvas.style.height = `${Math.ceil((x1 - x0) * mmX * unit + bottom + 4)}px`;
  const {g} = prepared(canvas);
  const X = (y) => left + (y - y0) * mmY * unit, Y = (x) => 4 + (x1 - x) * mmX * unit;
  for (const [x, y, value] of at) {
    const level = 3 * value;
    g.fillStyle = `rgb(${colours[level]},${colours[level + 1]},${colours[level + 2]})`;
    g.fillRect(X(y), Y(x + 1), mmY * unit + 1, mmX * unit + 1);
  }
  g.fillStyle = style("--quiet");
  g.font = "11px system-ui, sans-serif";
  g.textAlign = "center";
  g.textBaseline = "top";
  const step = [1, 2, 5, 10, 20, 50, 100].find((s) => (y1 - y0) * mmY / s <= 8) || 200;
  for (let v = Math.ceil(y0 * mmY / step) * step; v <= y1 * mmY; v += step) g.fillText(v, X(v / mmY), Y(x0) + 3);
  g.fillText("y, mm", X((y0 + y1) / 2), Y(x0) + 17);
  g.textAlign = "right";
  for (const [x, base] of [[x0, "bottom"], [x1, "top"]]) {
    g.textBaseline = base;
    g.fillText((x * mmX).toFixed(0), left - 5, Y(x));
  }
  g.textBaseline = "middle";
  g.fillText("x", left - 5, Y((x0 + x1) / 2));
}
