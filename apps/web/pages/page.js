// The live page. The server sends one "hello" with everything that stays, then an event for a picture, at most
// 30 a second; what the page cannot draw in time it never sees.
const HISTORY_S = 10, COLUMNS = 300;      // of the strips
const GUESS = 64;                         // level of half an interval's width (255 is the plate's height): +-0.25
const supertac = {hello: null, newest: null, shown: null, paused: false};  // looked at by the test
const strips = {times: new Float64Array(COLUMNS), felt: null, profile: null, end: 0};

// --- Drawing -------------------------------------------------------------------------------------------------

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
function image(levels, rows, columns) {
  scratch.width = columns;
  scratch.height = rows;
  const g = scratch.getContext("2d"), dots = g.createImageData(columns, rows), map = supertac.hello.map;
  for (let r = 0; r < rows; ++r)
    for (let c = 0; c < columns; ++c) {
      const level = levels[(rows - 1 - r) * columns + c], at = 4 * (r * columns + c);
      for (let k = 0; k < 3; ++k) dots.data[at + k] = map[3 * level + k];
      dots.data[at + 3] = 255;
    }
  g.putImageData(dots, 0, 0);
  return scratch;
}

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

// A picture with axes in mm from the finger's centre. Returns where the picture lies.
function drawPicture(g, w, h, levels, rows, columns, pixelMm, wide) {
  const left = 30, bottom = 32, top = 6, right = 6;
  const side = Math.min((w - left - right) / columns, (h - top - bottom) / rows);
  const box = {x: left, y: top, w: side * columns, h: side * rows};
  g.imageSmoothingEnabled = false;
  if (levels) g.drawImage(image(levels, rows, columns), box.x, box.y, box.w, box.h);
  if (levels && wide) hatch(g, wide, rows, columns, box);
  g.strokeStyle = g.fillStyle = style("--quiet");
  g.lineWidth = 1;
  g.strokeRect(box.x - .5, box.y - .5, box.w + 1, box.h + 1);
  g.font = "11px system-ui, sans-serif";
  const longer = Math.max(rows, columns) * pixelMm, step = [1, 2, 3, 5, 10, 20, 50].find((s) => longer / s <= 5) || 100;
  const ticks = (mm, draw) => { for (let v = -Math.floor(mm / 2 / step) * step; v <= mm / 2 + 1e-9; v += step) draw(v); };
  g.textAlign = "center";
  g.textBaseline = "top";
  ticks(columns * pixelMm, (v) => {
    const x = box.x + (v / pixelMm + columns / 2) * side;
    g.fillRect(x - .5, box.y + box.h, 1, 4);
    g.fillText(v, x, box.y + box.h + 5);
  });
  g.fillText("x, mm", box.x + box.w / 2, box.y + box.h + 19);
  g.textAlign = "right";
  g.textBaseline = "middle";
  ticks(rows * pixelMm, (v) => {
    const y = box.y + box.h - (v / pixelMm + rows / 2) * side;
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

// Without a model 1 is `top`, in the sensor's unit.
function drawBar(g, w, top, left = 30) {
  const map = supertac.hello.map, width = w - left - 6;
  for (let i = 0; i < 256; ++i) {
    g.fillStyle = `rgb(${map[3 * i]},${map[3 * i + 1]},${map[3 * i + 2]})`;
    g.fillRect(left + width * i / 256, 0, width / 256 + 1, 12);
  }
  g.fillStyle = style("--quiet");
  g.font = "11px system-ui, sans-serif";
  g.textBaseline = "top";
  const mm = supertac.hello.height_mm, narrow = w < 480, unit = supertac.hello.unit;
  const labels = unit ? [["0", "left", 0, "at rest"], ["0.5", "center", .5, ""],
                         ["1", "right", 1, top ? `${top.toPrecision(4)} ${unit} from rest` : ""]] : [["0", "left", 0, narrow ? "not pressed" : "not pressed, flat plate"], ["0.5", "center", .5, (mm / 2) + " mm"],
                  ["1", "right", 1, narrow ? `hard, ${mm} mm` : `pressed hard; ${mm} mm on the rig's plates`]];
  for (const [value, align, at, meaning] of labels) {
    g.textAlign = align;
    const x = left + width * at;
    g.fillRect(Math.min(x, left + width - 1), 12, 1, 4);
    g.fillText(value, x, 17);
    g.fillText(meaning, x, 31);
  }
}

// values [column][row], oldest first, the newest at the right edge.
function drawStrip(canvas, values, rows, labels, withTime) {
  const {g, w, h} = prepared(canvas), left = 30, bottom = withTime ? 18 : 0, height = h - bottom;
  const map = supertac.hello.map;
  scratch.width = COLUMNS;
  scratch.height = rows;
  const sg = scratch.getContext("2d"), dots = sg.createImageData(COLUMNS, rows);
  for (let c = 0; c < COLUMNS; ++c) {
    const slot = ((strips.end - COLUMNS + 1 + c) % COLUMNS + COLUMNS) % COLUMNS;
    if (strips.times[slot] !== strips.end - COLUMNS + 1 + c) continue;
    for (let r = 0; r < rows; ++r) {
      const level = values[slot * rows + r], at = 4 * ((rows - 1 - r) * COLUMNS + c);
      for (let k = 0; k < 3; ++k) dots.data[at + k] = map[3 * level + k];
      dots.data[at + 3] = 255;
    }
  }
  sg.putImageData(dots, 0, 0);
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

// --- What arrives --------------------------------------------------------------------------------------------

function remember(event) {
  const at = Math.round(event.t * COLUMNS / HISTORY_S), {rows, columns, scale} = supertac.hello;
  if (at < strips.end) strips.times.fill(NaN);  // another run
  const from = at - strips.end > 10 || at < strips.end ? at : strips.end + 1;  // held over a short silence
  const height = rows * scale, width = columns * scale, taxels = rows * columns;
  for (let c = from; c <= at; ++c) {
    const slot = c % COLUMNS;
    strips.times[slot] = c;
    strips.felt.set(event.felt, slot * taxels);
    if (!event.picture) continue;
    for (let r = 0; r < height; ++r) {
      let sum = 0;
      for (let k = 0; k < width; ++k) sum += event.picture[r * width + k];
      strips.profile[slot * height + r] = sum / width;
    }
  }
  strips.end = at;
}

function onHello(hello) {
  hello.map = bytes(hello.map);
  supertac.hello = hello;
  supertac.newest = null;
  strips.felt = new Uint8Array(COLUMNS * hello.rows * hello.columns);
  strips.profile = new Uint8Array(COLUMNS * hello.rows * hello.scale);
  strips.times.fill(NaN);
  strips.end = 0;
  element("badge").textContent = hello.badge;
  element("source").textContent = hello.source;
  element("felt-size").textContent = `${hello.rows} × ${hello.columns} taxels, ${hello.pitch_mm} mm apart`;
  element("drawn-size").textContent =
    `${hello.rows * hello.scale} × ${hello.columns * hello.scale} pixels of ${hello.pitch_mm / hello.scale} mm`;
  for (const id of ["texture-name", "texture"]) element(id).hidden = !hello.names_textures;
  element("guess-line").hidden = !hello.predicts_error;
  element("sure").hidden = !hello.predicts_error;
  for (const id of ["drawn", "profile"]) element(id).hidden = hello.unit !== "";
  element("drawn").closest("figure").hidden = element("profile").previousElementSibling.hidden = hello.unit !== "";
  for (const id of ["felt", "drawn"]) element(id).style.aspectRatio = `${hello.columns} / ${hello.rows}`;
}

function onPicture(event) {
  for (const name of ["felt", "picture", "wide"]) event[name] = event[name] ? bytes(event[name]) : null;
  if (event.felt) remember(event);
  supertac.newest = event;
}

function connect() {
  const source = new EventSource("/events");
  source.addEventListener("hello", (e) => onHello(JSON.parse(e.data)));
  source.onmessage = (e) => { alive = performance.now(); onPicture(JSON.parse(e.data)); };
  source.onerror = () => {
    alive = 0;
    if (source.readyState === EventSource.CLOSED) setTimeout(connect, 1000);  // else it tries again by itself
  };
}
let alive = 0;

// --- What is shown -------------------------------------------------------------------------------------------

function describe(name, levels, rows, columns, pixelMm) {
  let best = 0, sum = 0;
  for (let i = 0; i < levels.length; ++i) {
    sum += levels[i];
    if (levels[i] > levels[best]) best = i;
  }
  const mm = (i, n) => ((i + .5 - n / 2) * pixelMm).toFixed(1);
  return `${name}: highest ${(levels[best] / 255).toFixed(2)} at x ${mm(best % columns, columns)} mm, y ` +
         `${mm(Math.floor(best / columns), rows)} mm, mean ${(sum / levels.length / 255).toFixed(2)}`;
}

function setLamp(id, kind, text) {
  const lamp = element(id), name = "lamp " + kind;
  if (lamp.className !== name) lamp.className = name;
  if (lamp.textContent !== text) lamp.textContent = text;
}

function drawPictures(event) {
  const h = supertac.hello, rows = h.rows * h.scale, columns = h.columns * h.scale;
  const felt = prepared(element("felt"));
  const box = drawPicture(felt.g, felt.w, felt.h, event && event.felt, h.rows, h.columns, h.pitch_mm, null);
  cross(felt.g, box, h.silent, h.rows, h.columns);
  const bar = prepared(element("bar"));
  drawBar(bar.g, bar.w, event && event.top);
  drawStrip(element("taxels"), strips.felt, h.rows * h.columns, [["0", 0], [String(h.rows * h.columns - 1), 1]], h.unit !== "");
  if (h.unit) return;
  const drawn = prepared(element("drawn"));
  const wide = element("guess").checked && event ? event.wide : null;
  supertac.box = drawPicture(drawn.g, drawn.w, drawn.h, event && event.picture, rows, columns, h.pitch_mm / h.scale, wide);
  const half = h.rows * h.pitch_mm / 2;
  drawStrip(element("profile"), strips.profile, rows, [[-half, 0], ["0", .5], [half, 1]], true);
}

function showFigures(event) {
  const set = (id, text) => { if (element(id).textContent !== text) element(id).textContent = text; };
  set("texture", event.texture ? `${event.texture}, ${(100 * event.probability).toFixed(0)} %` : "none");
  set("rate", event.rate.toFixed(0) + " /s");
  set("p50", event.p50.toFixed(2) + " ms");
  set("p99", event.p99.toFixed(2) + " ms");
  set("lost", String(event.lost));
  set("dropped", String(event.dropped));
  set("time", event.t.toFixed(1) + " s");
  set("place", event.x === undefined ? "unknown" : `x ${event.x.toFixed(1)}, y ${event.y.toFixed(1)} mm`);
  if (supertac.hello.unit) setLamp("lamp", "", "no model: the array itself");
  else if (event.distance === undefined) setLamp("lamp", "unknown", event.picture ? "this model knows no doubt" : "filling the first window");
  else if (event.unlike) setLamp("lamp", "alarm", "UNLIKE TRAINING: do not trust this picture");
  else setLamp("lamp", "", "signals as in training");
  if (event.wide) {
    let guesses = 0, sum = 0;
    for (const level of event.wide) { sum += level; guesses += level > GUESS ? 1 : 0; }
    const share = 100 * guesses / event.wide.length;
    set("sure", `${share.toFixed(0)} % of the picture is a guess; 90 % intervals of its pixels: ` +
        `±${(sum / event.wide.length / 255).toFixed(2)} (mean)`);
  }
  const recording = event.recording || "";
  element("record").setAttribute("aria-pressed", recording !== "");
  element("record").firstChild.textContent = recording ? "Stop" : "Record";
  if (recording) set("said", `recording ${recording}, ${event.recorded_s.toFixed(1)} s`);
  else if (event.said !== heard) set("said", event.said || "none yet");
  heard = event.said;
  showFiles(event.files || []);
}

function showFiles(names) {
  const list = element("files");
  if (list.childElementCount === names.length) return;
  list.replaceChildren(...names.map((name) => {
    const item = document.createElement("li"), link = document.createElement("a");
    link.href = "/files/" + encodeURIComponent(name);
    link.download = name;
    link.textContent = name;
    item.append(link);
    return item;
  }));
}

let described = 0, figures = 0, heard = "";
function frame(now) {
  requestAnimationFrame(frame);
  const away = !supertac.hello || now - alive > 3000;
  document.body.classList.toggle("away", away);
  setLamp("link", away ? "alarm" : supertac.paused ? "unknown" : "",
          away ? "no connection, trying again" : supertac.paused ? "paused" : "live");
  if (!supertac.hello) return;
  const event = supertac.paused ? supertac.shown : supertac.newest;
  if (event && event !== supertac.shown || resized) {
    resized = false;
    supertac.shown = event;
    drawPictures(event);
  }
  if (supertac.paused) return;
  if (event && now - figures > 200) {
    figures = now;
    showFigures(event);
  }
  if (event && event.felt && now - described > 1000) {
    described = now;
    const h = supertac.hello;
    element("felt").setAttribute("aria-label", describe("felt", event.felt, h.rows, h.columns, h.pitch_mm));
    if (event.picture) element("drawn").setAttribute("aria-label",
        describe("drawn", event.picture, h.rows * h.scale, h.columns * h.scale, h.pitch_mm / h.scale));
  }
}
let resized = true;
addEventListener("resize", () => { resized = true; });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { resized = true; });

// --- What can be done ----------------------------------------------------------------------------------------

async function ask(action) {
  try {
    const answer = await fetch("/" + action, {method: "POST", headers: {"X-Token": supertac.hello.token}});
    element("said").textContent = (await answer.text()).trim();
  } catch (error) {
    element("said").textContent = "the program does not answer";
  }
}

function pause() {
  supertac.paused = !supertac.paused;
  element("pause").setAttribute("aria-pressed", supertac.paused);
}

// Both pictures with headings, axes, colour bar and what is known of them, on paper white.
function snapshot() {
  const event = supertac.shown, h = supertac.hello;
  if (!event || !event.felt) return;
  const page = document.createElement("canvas"), g = page.getContext("2d");
  page.width = 1640;
  page.height = 1000;
  g.fillStyle = "#fff";
  g.fillRect(0, 0, page.width, page.height);
  g.scale(2, 2);
  const root = document.documentElement.style;
  root.setProperty("--quiet", "#333");
  const alarm = event.unlike ? "; UNLIKE TRAINING" : "";
  const place = event.x === undefined ? "" : `, finger at x ${event.x.toFixed(1)} mm, y ${event.y.toFixed(1)} mm`;
  g.fillStyle = "#111";
  g.textBaseline = "top";
  g.font = "600 15px system-ui, sans-serif";
  g.fillText("The array feels", 40, 10);
  if (event.picture) g.fillText("The network draws", 450, 10);
  const panel = (x, levels, rows, columns, mm) => {
    g.save();
    g.translate(x, 34);
    drawPicture(g, 390, 392, levels, rows, columns, mm, null);
    g.restore();
  };
  panel(10, event.felt, h.rows, h.columns, h.pitch_mm);
  if (event.picture) panel(420, event.picture, h.rows * h.scale, h.columns * h.scale, h.pitch_mm / h.scale);
  g.save();
  g.translate(10, 430);
  drawBar(g, 800, event.top);
  g.restore();
  g.fillStyle = "#333";
  g.font = "11px system-ui, sans-serif";
  g.textAlign = "left";
  g.fillText(`${h.badge}: ${h.source}; ${event.t.toFixed(3)} s${place}${alarm}`, 40, 481);
  root.removeProperty("--quiet");
  const link = document.createElement("a");
  link.download = `supertac_${event.t.toFixed(3)}s.png`;
  page.toBlob((blob) => {
    link.href = URL.createObjectURL(blob);
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    element("said").textContent = "saved " + link.download;
  });
}

const actions = {
  pause, snapshot,
  record: () => ask(element("record").getAttribute("aria-pressed") === "true" ? "stop" : "record"),
  rezero: () => ask("rezero"),
};
for (const id of Object.keys(actions)) element(id).addEventListener("click", actions[id]);
element("guess").addEventListener("change", () => { resized = true; });
const keys = {" ": "pause", r: "record", z: "rezero", s: "snapshot"};
addEventListener("keydown", (e) => {
  if (e.ctrlKey || e.metaKey || e.altKey || e.repeat) return;
  const key = e.key.toLowerCase();
  if (key === "g") element("guess").click();
  if (!keys[key] || (key === " " && e.target !== document.body)) return;
  e.preventDefault();
  actions[keys[key]]();
});

connect();
requestAnimationFrame(frame);
