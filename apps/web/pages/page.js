// How the pages' scripts relate: a page has one script, put together of files in this order (../CMakeLists.txt).
// look.js has what all pages share. link.js brings the events of the program to the live page and to that of a
// collection. drawing.js draws the canvases of the live page, and this file says what is on them. collect.js is the page
// of a collection, and report.js that of results, which no program is behind.
//
// The live page. The server sends one "hello" with everything that stays, then an event for a picture, at most
// 30 a second; what the page cannot draw in time it never sees.
const HISTORY_S = 10, COLUMNS = 300;      // of the strips
const GUESS = 64;                         // level of half an interval's width (255 is the plate's height): +-0.25
const supertac = {hello: null, newest: null, shown: null, paused: false};  // looked at by the test
const strips = {times: new Float64Array(COLUMNS), felt: null, profile: null, end: 0};

// --- What arrives --------------------------------------------------------------------------------------------

function remember(event) {
  const at = Math.round(event.t * COLUMNS / HISTORY_S), {rows, columns, scale} = supertac.hello;
  if (at < strips.end) strips.times.fill(NaN);  // another run
  const from = at - strips.end > 10 || at < strips.end ? at : strips.end + 1;  // held over a short silence
  const height = rows * scale, width = columns * scale, taxels = rows * columns;
  for (let c = from; c <= at; ++c) {
    const slot = c % COLUMNS;
    strips.times[slot] = c;
    for (let k = 0; k < taxels; ++k) strips.felt[slot * taxels + k] = event.felt[k] / 255 * event.top;
    if (!event.picture) continue;
    for (let r = 0; r < height; ++r) {
      let sum = 0;
      for (let k = 0; k < width; ++k) sum += event.picture[r * width + k];
      strips.profile[slot * height + r] = sum / width;
    }
  }
  strips.end = at;
}

// The surface that was felt: the level of each cell, by its place. The program sends what has changed.
const surface = new Map();
function mend({left, bottom, width, values, known}) {
  const levels = bytes(values), isKnown = bytes(known);
  for (let i = 0; i < levels.length; ++i)
    if (isKnown[i]) surface.set(`${left + i % width},${bottom + Math.floor(i / width)}`, levels[i]);
}

const sizeText = ([x, y]) => x === y ? `${x}` : `${x} × ${y}`;

function onHello(hello) {
  hello.colours = bytes(hello.colours);
  hello.pixel_mm = hello.pitch_mm.map((mm) => mm / hello.scale);
  supertac.hello = hello;
  supertac.newest = null;
  strips.felt = new Float32Array(COLUMNS * hello.rows * hello.columns);
  strips.profile = new Uint8Array(COLUMNS * hello.rows * hello.scale);
  strips.times.fill(NaN);
  strips.end = 0;
  element("badge").textContent = hello.badge;
  element("source").textContent = hello.source;
  element("felt-size").textContent = `${hello.rows} × ${hello.columns} taxels, ${sizeText(hello.pitch_mm)} mm apart`;
  element("drawn-size").textContent =
    `${hello.rows * hello.scale} × ${hello.columns * hello.scale} pixels of ${sizeText(hello.pixel_mm)} mm` +
    (hello.delay_s > 0 ? `, as it was ${hello.delay_s} s ago` : "");
  element("guess-line").hidden = !hello.predicts_error;
  element("sure").hidden = !hello.predicts_error;
  element("drawn").closest("figure").hidden = !hello.draws;
  element("most").hidden = hello.draws;
  element("found").hidden = hello.found.length === 0;
  element("found-text").textContent = hello.found.join("\n");
  element("profile").hidden = element("profile").previousElementSibling.hidden = !hello.draws;
  element("rate-name").textContent = hello.draws ? "pictures" : "frames";
  element("slide").hidden = true;
  showElements({text: "", rows: []});
  for (const button of document.querySelectorAll("nav button")) button.disabled = false;
  surface.clear();
  ended = null;
  const ratio = `${hello.columns * hello.pitch_mm[0]} / ${hello.rows * hello.pitch_mm[1]}`;
  for (const id of ["felt", "drawn"]) element(id).style.aspectRatio = ratio;
}

function onPicture(event) {
  for (const name of ["felt", "picture", "wide"]) event[name] = event[name] ? bytes(event[name]) : null;
  if (event.felt) remember(event);
  if (event.map) {
    element("slide").hidden = false;
    mend(event.map);
  }
  if (event.elements) showElements(event.elements);
  supertac.newest = event;
}

let ended = null;
const link = new Link({
  hello: onHello,
  news: onPicture,
  end: (end) => {
    ended = end;
    element("record").setAttribute("aria-pressed", false);
    element("record").firstChild.textContent = "Record";
    element("said").textContent = "the run has ended";
    for (const button of document.querySelectorAll("nav button")) button.disabled = button.id !== "snapshot";
  },
});

// --- What is shown -------------------------------------------------------------------------------------------

function describe(name, levels, rows, columns, [mmX, mmY]) {
  let best = 0, sum = 0;
  for (let i = 0; i < levels.length; ++i) {
    sum += levels[i];
    if (levels[i] > levels[best]) best = i;
  }
  const mm = (i, n, pixel) => ((i + .5 - n / 2) * pixel).toFixed(1);
  return `${name}: highest ${(levels[best] / 255).toFixed(2)} at x ${mm(best % columns, columns, mmX)} mm, y ` +
         `${mm(Math.floor(best / columns), rows, mmY)} mm, mean ${(sum / levels.length / 255).toFixed(2)}`;
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
  if (event && event.asked !== undefined) ring(felt.g, box, event.asked, h.rows, h.columns);
  const feltBar = prepared(element("felt-bar"));
  drawBar(feltBar.g, feltBar.w, feltEnds(event, feltBar.w));
  drawStrip(element("taxels"), strips.felt, event && event.felt ? event.top : 1, h.rows * h.columns,
            [["0", 0], [String(h.rows * h.columns - 1), 1]], !h.draws);
  if (!h.draws) return;
  const drawn = prepared(element("drawn"));
  const wide = element("guess").checked && event ? event.wide : null;
  supertac.box = drawPicture(drawn.g, drawn.w, drawn.h, event && event.picture, rows, columns, h.pixel_mm, wide);
  const drawnBar = prepared(element("drawn-bar"));
  drawBar(drawnBar.g, drawnBar.w, drawnEnds(drawnBar.w));
  drawMap();
  const half = h.rows * h.pitch_mm[1] / 2;
  drawStrip(element("profile"), strips.profile, 255, rows, [[-half, 0], ["0", .5], [half, 1]], true);
}

// What corrects "order" and "dead" in a sensor's file: which taxel answers to the finger, and from where to where.
function mostText({taxel, channel, rest, now}) {
  const {columns, channels} = supertac.hello, digits = Math.abs(now - rest) < 10 ? 3 : 0;
  return `taxel ${taxel}, row ${Math.floor(taxel / columns)}, column ${taxel % columns}` +
         (channels > 1 ? `, channel ${channel}` : "") + `: ${rest.toFixed(digits)} at rest, ${now.toFixed(digits)} now`;
}

function askText({asked, order = ""}) {
  const {rows, columns, silent} = supertac.hello;
  if (asked === undefined) return order || "Press the places one after the other, and the file gets the order in which frames send them.";
  return (order ? `${order}. ` : "") + `Place ${asked + 1} of ${rows * columns}: press row ${Math.floor(asked / columns)}, ` +
         `column ${asked % columns}, which is framed, and let go; row 0 is at the bottom. ` +
         (silent.includes(asked) ? "The file says that nothing answers there. " : "") + "Escape: the file stays as it is.";
}

function showFigures(event) {
  const set = (id, text) => { if (element(id).textContent !== text) element(id).textContent = text; };
  set("rate", event.rate.toFixed(0) + " /s");
  set("p50", event.p50.toFixed(2) + " ms");
  set("p99", event.p99.toFixed(2) + " ms");
  set("lost", String(event.lost));
  set("dropped", String(event.dropped));
  set("most", event.most ? mostText(event.most) : "press a taxel: its number is shown here");
  set("ask", askText(event));
  element("order").setAttribute("aria-pressed", event.asked !== undefined);
  element("skip").disabled = event.asked === undefined;
  set("time", event.t.toFixed(1) + " s");
  set("place", event.x === undefined ? "unknown" : `x ${event.x.toFixed(1)}, y ${event.y.toFixed(1)} mm`);
  if (!supertac.hello.draws) setLamp("lamp", "", "no model: the array itself");
  else if (!event.picture) setLamp("lamp", "unknown", "filling the first window");
  else if (event.distance === undefined) setLamp("lamp", "unknown", "this model cannot tell unfamiliar signals");
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
}

function showElements({text, rows}) {
  element("elements-text").textContent = text;
  element("elements").hidden = rows.length === 0;
  const off = (value, half) => `${value.toFixed(1)} ± ${half.toFixed(1)}`;
  element("elements").querySelector("tbody").replaceChildren(...rows.map((e, i) => {
    const row = document.createElement("tr");
    const cells = [i + 1, off(e.x_mm, e.x_off_mm), off(e.y_mm, e.y_off_mm), `${e.height.toFixed(2)} ± ${e.height_off.toFixed(2)}`,
                   `${e.open ? "≥ " : ""}${e.length_mm.toFixed(1)} × ${e.width_mm.toFixed(1)}`];
    row.append(...cells.map((cell) => Object.assign(document.createElement("td"), {textContent: cell})));
    return row;
  }));
}

let described = 0, figures = 0, heard = "";
function frame(now) {
  requestAnimationFrame(frame);
  const away = !ended && link.away();
  document.body.classList.toggle("away", away);
  if (ended) setLamp("link", ended.failed ? "alarm" : "unknown", ended.outcome);
  else setLamp("link", away ? "alarm" : supertac.paused ? "unknown" : "",
               away ? "no connection, trying again" : supertac.paused ? "paused" : "live");
  if (!supertac.hello) return;
  const event = supertac.paused ? supertac.shown : supertac.newest;
  if (event && event !== supertac.shown || resized) {
    resized = false;
    supertac.shown = event;
    drawPictures(event);
  }
  if (supertac.paused) return;
  if (event && !ended && now - figures > 200) {
    figures = now;
    showFigures(event);
  }
  if (event && event.felt && now - described > 1000) {
    described = now;
    const h = supertac.hello;
    element("felt").setAttribute("aria-label", describe("felt", event.felt, h.rows, h.columns, h.pitch_mm));
    if (event.picture) element("drawn").setAttribute("aria-label",
        describe("drawn", event.picture, h.rows * h.scale, h.columns * h.scale, h.pixel_mm));
  }
}
let resized = true;
addEventListener("resize", () => { resized = true; });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { resized = true; });

// --- What can be done ----------------------------------------------------------------------------------------

async function ask(action, id = "said") { element(id).textContent = await link.act(action); }

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
  const place = event.x === undefined ? "" : `, centre at x ${event.x.toFixed(1)} mm, y ${event.y.toFixed(1)} mm`;
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
  if (event.picture) panel(420, event.picture, h.rows * h.scale, h.columns * h.scale, h.pixel_mm);
  g.save();
  g.translate(10, 430);
  drawBar(g, 390, feltEnds(event, 390));
  g.translate(410, 0);
  if (event.picture) drawBar(g, 390, drawnEnds(390));
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
  order: () => ask("order", "ask"),
  skip: () => ask("skip", "ask"),
};
for (const id of Object.keys(actions)) element(id).addEventListener("click", actions[id]);
element("guess").addEventListener("change", () => { resized = true; });
const keys = {" ": "pause", r: "record", z: "rezero", s: "snapshot", o: "order", n: "skip"};
addEventListener("keydown", (e) => {
  if (e.ctrlKey || e.metaKey || e.altKey || e.repeat) return;
  const key = e.key.toLowerCase();
  if (key === "g") element("guess").click();
  const button = element(keys[key]);
  if (key === "escape" && !element("skip").disabled) ask("leave", "ask");
  if (!button || button.disabled || button.closest("[hidden]") || (key === " " && e.target !== document.body)) return;
  e.preventDefault();
  actions[keys[key]]();
});

requestAnimationFrame(frame);
