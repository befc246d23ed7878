// A page of results: the JSON of an evaluation with the pictures of some windows, or the log of a training.
const data = JSON.parse(element("data").textContent);

function make(tag, attributes, ...content) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...content);
  return node;
}

const section = (title, note, ...content) =>
    make("section", {class: "card"}, make("h2", {}, title), make("p", {class: "quiet"}, note), ...content);

// A number with its decimals, or a text.
const text = (value, decimals) =>
    typeof value === "string" ? value : typeof value === "number" ? value.toFixed(decimals) : "-";

// Each column is a head and the decimals of its numbers; the first row is the page's own where `own` says so.
function table(columns, rows, own) {
  const head = make("tr", {}, ...columns.map(([name]) => make("th", {scope: "col"}, name)));
  const body = rows.map((row, n) => make("tr", own && n === 0 ? {class: "own"} : {},
      ...columns.map(([, decimals], c) => make("td", {}, text(row[c], decimals)))));
  return make("div", {class: "scroll"}, make("table", {}, make("thead", {}, head), make("tbody", {}, ...body)));
}

// Round numbers from `low` to `high`, at most some eight.
function ticks(low, high, logarithmic) {
  const numbers = [], fits = (v) => v >= low * (1 - 1e-9) - 1e-12 && v <= high * (1 + 1e-9) + 1e-12;
  if (logarithmic) {
    const decades = Math.log10(high / low), every = Math.max(1, Math.ceil(decades / 7));
    for (let e = Math.floor(Math.log10(low)); e <= Math.log10(high); e += every)
      for (const digit of decades <= 2.5 ? [1, 2, 5] : [1])
        if (fits(Number(`${digit}e${e}`))) numbers.push(Number(`${digit}e${e}`));
    if (numbers.length >= 2) return numbers;
  }
  const exponent = Math.floor(Math.log10((high - low) / 6)), share = (high - low) / 6 / 10 ** exponent;
  const step = Number(`${share <= 1 ? 1 : share <= 2 ? 2 : share <= 5 ? 5 : 10}e${exponent}`);
  return Array.from({length: 9}, (_, i) => (Math.ceil(low / step - 1e-9) + i) * step)
      .filter((v) => v <= high + 1e-9 * step).map((v) => Number(v.toPrecision(9)));
}

// Where values lie on an axis, between two places of the chart; it holds them and no more.
function axis(values, from, to, {logarithmic, most = Infinity}) {
  const of = logarithmic ? Math.log10 : (v) => v, back = logarithmic ? (v) => 10 ** v : (v) => v;
  let low = of(Math.min(...values)), high = of(Math.max(...values));
  const room = high > low ? 0.04 * (high - low) : Math.max(logarithmic ? 0.1 : 1e-6, 0.1 * Math.abs(low));
  low -= room, high = Math.min(high + room, most);
  return {at: (v) => (from + (to - from) * (of(v) - low) / (high - low)).toFixed(1),
    numbers: ticks(back(low), back(high), logarithmic)};
}

// `series`: {name: [[x, y], ...]}. What an axis cannot show is left out, and so is a chart of nothing.
function chart(title, x, y, series) {
  const fits = (v, side) => Number.isFinite(v) && (v > 0 || !side.logarithmic);
  const shown = Object.entries(series).map(([name, points]) =>
    [name, points.filter(([a, b]) => fits(a, x) && fits(b, y))]).filter(([, points]) => points.length > 0);
  if (shown.length === 0) return "";
  const all = shown.flatMap(([, points]) => points), left = 62, right = 606, top = 44, bottom = 230;
  const across = axis(all.map(([a]) => a), left, right, x), up = axis(all.map(([, b]) => b), bottom, top, y);
  const words = (at, to, anchor, said, more = "") =>
      `<text x="${at}" y="${to}" text-anchor="${anchor}" ${more}>${said}</text>`;
  const colour = (n) => `var(--${["accent", "second"][n]})`;
  const lines = up.numbers.map((v) => `<path d="M${left} ${up.at(v)}H${right}" stroke="var(--line)"/>` +
      words(left - 6, Number(up.at(v)) + 4, "end", v));
  const marks = across.numbers.map((v) => `<path d="M${across.at(v)} ${bottom}v4" stroke="var(--line)"/>` +
      words(across.at(v), bottom + 16, "middle", v));
  const curves = shown.map(([name, points], n) => {
    const places = points.map(([a, b]) => [across.at(a), up.at(b)]);
    const legend = shown.length < 2 ? "" : `<rect x="${left + 180 * n}" y="22" width="14" height="4"
        fill="${colour(n)}"/>` + words(left + 180 * n + 19, 28, "start", name);
    const dot = ([a, b]) => `<circle cx="${a}" cy="${b}" r="3.5" fill="${colour(n)}"/>`;
    const dots = points.length < 40 ? places.map(dot) : [];
    return `<polyline fill="none" stroke-width="1.8" stroke="${colour(n)}" points="${places.join(" ")}"/>` +
        dots.join("") + legend;
  });
  return `<svg viewBox="0 0 620 270" role="img" aria-label="${title}">` +
      words(left, 13, "start", title, 'class="title"') +
      [...lines, ...marks, ...curves].join("") + words((left + right) / 2, 264, "middle", x.label) +
      `<g transform="translate(12 ${(top + bottom) / 2}) rotate(-90)">` +
      `${words(0, 0, "middle", y.label || "")}</g></svg>`;
}

function curves(title, note, charts) {
  const two = make("div", {class: "two"});
  two.innerHTML = charts.join("");  // of our own names and numbers alone
  return section(title, note, two);
}

function training() {
  const [head, ...lines] = data.log.trim().split("\n").map((line) => line.split(","));
  const of = (name, by = (v) => v) => lines.filter((l) => l[head.indexOf(name)] !== "")
      .map((l) => [Number(l[head.indexOf("step")]), by(Number(l[head.indexOf(name)]))]);
  const ssim = (by) => ({"training pictures": of("ssim", by), "test pictures in contact": of("test_ssim", by)});
  const step = {label: "step"}, log = {logarithmic: true};
  const other = (title, name, y) => chart(title, step, y, {[name]: of(name)});
  return [
    curves("Learning curves", "training pictures are augmented and of whole passes, test pictures in contact", [
      chart("SSIM, linear axes", step, {label: "SSIM", most: 1}, ssim()),
      chart("1 - SSIM, logarithmic axes", {...step, ...log}, {label: "1 - SSIM", ...log}, ssim((v) => 1 - v))]),
    curves("Other curves", "means over the steps since the point before", [
      other("Loss", "total", log), other("Mean squared error of the pictures", "l2", log),
      other("Reconstruction error of the VAEs", "reconstruction", log),
      other("Kullback-Leibler divergence", "kld", {}),
      other("PSNR of test pictures in contact, dB", "test_psnr_db", {}),
      other("Gradient norm before clipping", "gradient_norm", log)])];
}

// Windows side by side: what was felt, drawn and true, and how far apart the last two are.
function windows(title, note, chosen) {
  if (chosen.length === 0) return "";
  const colours = bytes(data.colours), {rows, columns, scale} = data;
  const picture = (what, name, levels, r, c) => {
    const canvas = make("canvas", {role: "img", "aria-label": `${what}, ${name}`});
    paint(canvas, colours, r, c, (row, column) => levels[(r - 1 - row) * c + column]);
    return make("span", {}, canvas, what);
  };
  return section(title, note, make("div", {class: "windows"}, ...chosen.map((one) => {
    const felt = bytes(one.felt), drawn = bytes(one.drawn), truth = bytes(one.true);
    const fine = (what, levels) => picture(what, one.name, levels, rows * scale, columns * scale);
    return make("figure", {class: "window"},
        make("p", {}, one.name, make("br", {}), `SSIM ${text(one.ssim, 3)}, PSNR ${text(one.psnr_db, 1)} dB`),
        make("div", {}, picture("felt", one.name, felt, rows, columns), fine("drawn", drawn), fine("true", truth),
            fine("difference", drawn.map((v, i) => Math.abs(v - truth[i])))));
  })));
}

function evaluation() {
  const r = data.result, measured = "contact_level" in r, percent = (v) => typeof v === "number" ? 100 * v : v;
  const method = ([name, m]) => [name, m.contact.ssim, m.contact.psnr_mean_db, m.contact.position_error_mm,
    m.all.ssim, m.all.psnr_mean_db, r.latency[name].median_us];
  const zones = ["contact", "edge", "flat", "air", "all"].filter((z) => z in r && !(measured && z === "air"));
  const groups = table([[data.grouped ? "group" : "plate"], ["contact", 0], ["SSIM", 3], ["PSNR dB", 2],
    ["position mm", 2], ["all SSIM", 3]], r.groups.map((g) =>
    [g.name, g.contact.windows, g.contact.ssim, g.contact.psnr_mean_db, g.contact.position_error_mm, g.all.ssim]));
  const zone = table([["zone"], ["windows", 0], ["SSIM", 3], ["PSNR dB", 2], ["ghosts %", 2],
    ["misses %", 2]], zones.map((z) =>
    [measured && z === "flat" ? "rest" : z, r[z].windows, r[z].ssim, r[z].psnr_mean_db, percent(r[z].ghost_rate),
      percent(r[z].miss_rate)]));
  const parts = [
    make("p", {class: "quiet"},
        `${r.model}, split ${r.split}, ${r.all.windows} windows, ${r.contact.windows} in contact`),
    section("Scores beside the baselines", measured ? "contact windows: something presses the array" :
      "contact windows: some texture lies under the array",
    table([["method"], ["contact SSIM", 3], ["PSNR dB", 2], ["position mm", 2], ["all SSIM", 3], ["PSNR dB", 2],
      ["one picture, us", 1]], [["network", r], ...Object.entries(r.baselines || {})].map(method), true)),
    make("div", {class: "two"}, section(data.grouped ? "By group" : "By plate", "the worst first", groups),
        section(measured ? "Contact, edge, rest" : "Contact, flat plate, air", (measured ?
          `contact: a pixel of the measured truth shows more than ${text(r.contact_level, 3)}; edge: it reaches ` +
          "the array's border; ghosts: pictures that show something at rest; misses: pictures that show nothing " +
          "of a contact" :
          "ghosts: pictures that show a texture where the plate is flat; misses: pictures that show nothing of one; " +
          "windows beside a texture, within 3 mm of it, count among all only"), zone))];
  if (r.trust.coverage_of)
    parts.push(section("Intervals", "nine pixels in ten of each height should lie within", table([["pixels"],
      ["number", 0], ["within %", 1], ["half width", 3]], Object.entries(r.trust.coverage_of).map(([name, held]) =>
      [name, held.pixels, percent(held.share), held.half_width]))));
  if (r.by_distance.length > 0)
    parts.push(section("By distance since the first contact",
        "a texture cannot be known before its second element is under the array; contact windows",
        table([["slid from, mm", 0], ["windows", 0], ["SSIM", 3], ["PSNR dB", 2]],
            r.by_distance.map((part) => [part.from_mm, part.windows, part.ssim, part.psnr_mean_db]))));
  const elements = Object.entries(r.map ? r.map.surfaces : {}).flatMap(([name, surface]) =>
    (surface.elements || []).map((e) => [name, ...Object.values(e)]));
  if (elements.length > 0) {
    const first = Object.values(r.map.surfaces).find((surface) => surface.elements).elements[0];
    parts.push(section("Elements", "that the maps of all passes of a plate and trial show",
        table([["map"], ...Object.keys(first).map((key) => [key, 2])], elements)));
  }
  return [...parts, windows("The worst of each", "the groups in the order of their scores", data.worst_of_groups),
    windows("The worst windows", "in contact, by SSIM; no two within 3 mm of one pass, or 20 frames", data.worst),
    windows("The best windows", "of those with something on a quarter of the picture", data.best),
    section("What made this page", "", make("div", {class: "facts"}, table([["", 0], ["", 0]], data.made_by)))];
}

element("title").textContent = document.title = data.title;
try {
  element("content").append(...(data.log === undefined ? evaluation() : training()));
} catch (error) {
  element("content").append(make("p", {class: "card"}, `This page cannot be drawn: ${error}`));
}
