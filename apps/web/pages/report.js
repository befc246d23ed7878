// The films of a result page, where it has some: a pass is chosen, a slider goes through it.
const films = JSON.parse(element("films").textContent);
const map = bytes(films.map || "");
let playing = 0;

const draw = (canvas, levels, rows, columns) =>
    paint(canvas, map, rows, columns, (r, c) => levels[(rows - 1 - r) * columns + c]);

function show() {
  const {rows, columns, scale} = films, pass = films.passes[element("pass").selectedIndex];
  const frame = pass.frames[element("at").value], levels = bytes(frame.levels), taxels = rows * columns;
  const pixels = taxels * scale * scale;
  draw(element("film-felt"), levels.subarray(0, taxels), rows, columns);
  draw(element("film-drawn"), levels.subarray(taxels, taxels + pixels), rows * scale, columns * scale);
  draw(element("film-true"), levels.subarray(taxels + pixels), rows * scale, columns * scale);
  element("film-label").textContent = `${pass.name}: ${frame.place}, ` +
      `${frame.zone}, SSIM ${frame.ssim.toFixed(3)}`;
}

function choose() {
  element("at").max = films.passes[element("pass").selectedIndex].frames.length - 1;
  element("at").value = 0;
  show();
}

function play() {
  playing = playing ? (clearInterval(playing), 0) : setInterval(() => {
    const at = element("at");
    at.value = Number(at.value) === Number(at.max) ? 0 : Number(at.value) + 1;
    show();
  }, 120);
  element("play").textContent = playing ? "Pause" : "Play";
}

if (films.passes.length > 0) {
  element("pass").append(...films.passes.map((pass) => new Option(pass.name)));
  element("pass").addEventListener("change", choose);
  element("at").addEventListener("input", show);
  element("play").addEventListener("click", play);
  draw(element("bar"), Uint8Array.from({length: 256}, (_, i) => i), 1, 256);
  choose();
}
