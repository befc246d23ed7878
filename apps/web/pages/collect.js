// The page of a collection: where the finger is, and a button that does what Ctrl-C does. Nothing here moves it.
let hello = null, newest = null, texture = null, ended = null, stopping = false;

// The plate's heights as an image, y to the right.
function textureOf(h) {
  const levels = bytes(h.heights), image = document.createElement("canvas");
  return paint(image, bytes(h.colours), h.width, h.length, (row, y) => levels[y * h.width + h.width - 1 - row]);
}

function draw() {
  const canvas = element("plate"), ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
  canvas.width = w * ratio;
  canvas.height = h * ratio;
  const g = canvas.getContext("2d"), left = 34, margin = 10;
  g.scale(ratio, ratio);
  // Half a finger of room on every side of the plate.
  const unit = Math.min((w - left - margin) / (hello.length + 12), (h - 34) / (hello.width + 12));
  const X = (y) => left + (y + 6) * unit, Y = (x) => 4 + (hello.width + 6 - x) * unit;
  g.imageSmoothingEnabled = false;
  g.drawImage(texture, X(0), Y(hello.width), hello.length * unit, hello.width * unit);
  g.strokeStyle = g.fillStyle = style("--quiet");
  g.strokeRect(X(0) - .5, Y(hello.width) - .5, hello.length * unit + 1, hello.width * unit + 1);
  g.font = "11px system-ui, sans-serif";
  g.textAlign = "center";
  g.textBaseline = "top";
  for (let y = 0; y <= hello.length; y += 18) g.fillText(y, X(y), Y(-6) + 2);
  g.fillText("y, mm", X(hello.length / 2), Y(-6) + 15);
  g.textAlign = "right";
  g.textBaseline = "middle";
  for (let x = 0; x <= hello.width; x += 12) g.fillText(x, left - 2, Y(x));
  g.save();
  g.translate(7, Y(hello.width / 2));
  g.rotate(-Math.PI / 2);
  g.textAlign = "center";
  g.fillText("x, mm", 0, 0);
  g.restore();
  hello.passes.forEach((x, i) => {
    g.strokeStyle = newest && i + 1 < newest.pass ? "#fffc" : "#fff8";
    g.setLineDash(newest && i + 1 < newest.pass ? [] : [3, 4]);
    g.beginPath();
    g.moveTo(X(0), Y(x));
    g.lineTo(X(hello.length), Y(x));
    g.stroke();
  });
  if (!newest) return;
  g.setLineDash(newest.lifted ? [5, 4] : []);
  for (const [color, width] of [["#000", 5], ["#ffb454", 3]]) {
    g.strokeStyle = color;
    g.lineWidth = width;
    g.strokeRect(X(newest.y - 6), Y(newest.x + 6), 12 * unit, 12 * unit);
  }
}

const duration = (s) => `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, "0")}`;

function show() {
  const e = newest, set = (id, text) => { element(id).textContent = text; };
  set("pass", `${e.pass} of ${hello.passes.length}`);
  set("phase", e.phase + (e.lifted ? ", lifted" : ""));
  set("place", `x ${e.x.toFixed(1)}, y ${e.y.toFixed(1)} mm`);
  set("left", duration(e.left_s));
  set("frames", e.frames);
  set("rate", e.rate.toFixed(0) + " /s");
  set("lost", e.lost);
  set("suspect", e.suspect);
  element("done").value = e.done;
  element("plate").setAttribute("aria-label", `finger at x ${e.x.toFixed(0)} mm, y ${e.y.toFixed(0)} mm of the plate`);
}

function frame() {
  requestAnimationFrame(frame);
  const away = !ended && link.away(), lamp = element("link");
  document.body.classList.toggle("away", away);
  lamp.className = away || ended && ended.failed ? "lamp alarm" : "lamp";
  lamp.textContent = ended ? ended.outcome : away ? "no connection, trying again" : "live";
  if (!hello || !dirty) return;
  dirty = false;
  draw();
  if (newest) show();
}
let dirty = false;
addEventListener("resize", () => { dirty = true; });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { dirty = true; });

const say = (text) => { element("said").textContent = text; };
const link = new Link({
  hello: (h) => {
    hello = h;
    texture = textureOf(hello);
    newest = ended = null;
    stopping = false;
    dirty = true;
    element("badge").textContent = hello.plate;
    element("source").textContent = hello.source;
    element("plan").textContent = hello.plan;
  },
  news: (news) => {
    newest = news;
    dirty = true;
    if (stopping && news.lifted) say("the finger is lifted; the run ends");
  },
  end: (end) => {
    ended = end;
    if (stopping) say(end.outcome);
  },
});

// Nothing but what the machine does ends the asking.
element("stop").addEventListener("click", async () => {
  stopping = true;
  say("asking the program to stop");
  const answer = await link.act("stop", (n) => {
    if (ended) return false;
    say(`not heard yet, asked ${n} times; Ctrl-C in the program's terminal and the printer's switch stop it too`);
    return true;
  });
  if (!ended) say(answer);
});
requestAnimationFrame(frame);
