// What a reader does with the charts of a page: zoom (drag, double click goes back), values under the cursor, curves on
// and off, the picture as PNG or SVG, the data as CSV; all of it with the keyboard, too.
const DATA = JSON.parse(document.getElementById("feedsim-data").textContent);
const KEYS = "Drag to zoom, double-click to go back. Keys: arrows move the cursor, page up and down change the panel, + and − zoom, 0 goes back.";
const arrays = new Map();

// Curves of the page (embedded.py): blocks of rows in whole steps from the block's middle, or 32-bit floats (0 rows). steps:
// of the blocks; in_one: rows of each.
function values(k) {
  if (!arrays.has(k)) {
    const [rows, text] = DATA.arrays[k], raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    let result = new Float32Array(rows ? 0 : bytes.buffer);
    if (rows) {
      let count = 0; // of the blocks: 16 bytes each, and 4 bytes a row
      while (16 * count + 4 * rows * count < raw.length) count++;
      const heads = new Float64Array(bytes.buffer, 0, 2 * count), whole = new Int32Array(bytes.buffer, 16 * count);
      result = new Float64Array(whole.length);
      for (let i = 0; i < whole.length; i++) {
        const block = 2 * Math.floor(i / rows);
        result[i] = whole[i] === -(2 ** 31) ? NaN : heads[block] + heads[block + 1] * whole[i];
      }
      result.steps = heads.filter((entry, i) => i % 2);
      result.in_one = rows;
    }
    arrays.set(k, result);
  }
  return arrays.get(k);
}

// Digits of a row that count: no more than its array has, six or as many as a share of what is seen needs; 0: it is none.
function counting(k, row, seen = 0) {
  const own = values(k), value = Math.abs(own[row]), size = Math.floor(Math.log10(value));
  const step = own.steps && own.steps[Math.floor(row / own.in_one)], known = own instanceof Float32Array ? value * 2 ** -23 : step && step !== 1 ? step : 0;
  const finest = Math.max(known, value * 1e-13), down_to = place => size - place + 1;
  if (!Number.isFinite(size)) return 6;
  if (!seen) return Math.max(1, Math.min(15, down_to(Math.floor(Math.log10(finest)))));
  return Math.max(0, Math.min(15, down_to(Math.ceil(Math.log10(finest))), Math.max(6, down_to(Math.floor(Math.log10(seen * 1e-5))))));
}

function element(name, attributes, parent, text = null) {
  const result = document.createElement(name);
  for (const key in attributes) result.setAttribute(key, attributes[key]);
  if (text !== null) result.textContent = text;
  parent.append(result);
  return result;
}

const written_at = (k, row, [low, high]) => {
  const digits = counting(k, row, high - low);
  return number(digits ? values(k)[row] : 0, digits || 1);
};

class Live {
  constructor(figure) {
    this.figure = figure;
    figure.live = this; // for who would steer a chart from outside
    this.stem = figure.id;
    this.chart = DATA.charts[this.stem];
    this.hidden = new Set();
    this.told_apart();
    this.zooms = this.chart.panels.map(() => ({ x: null, y: null }));
    this.reaches = this.chart.panels.map(panel => panel.kind === "polar" ? panel.ring * panel.rings : 0);
    this.cursor = null; // panel and abscissa of the keyboard's cursor
    this.room = document.createElement("div");
    this.room.className = "live";
    this.bar = element("div", { class: "bar" }, this.room);
    this.field = element("div", { class: "field" }, this.room);
    this.readout = element("div", { class: "readout", hidden: "" }, this.field);
    this.spoken = element("div", { class: "spoken", role: "status", "aria-live": "polite" }, this.room);
    this.buttons();
    figure.querySelector(".still").replaceWith(this.room);
  }

  // On grey paper dashes distinguish lines that differ in colour alone (style.css.j2).
  told_apart() {
    const seen = [], lines = this.chart.panels.flatMap(panel => panel.curves || []).filter(entry => !entry.dots && !entry.filled && !entry.dash && entry.width < 5);
    for (const curve of lines) {
      if (!seen.includes(curve.colour)) seen.push(curve.colour);
      curve.grey = seen.indexOf(curve.colour);
    }
  }

  buttons() {
    const names = new Map();
    for (const panel of this.chart.panels) for (const curve of [...(panel.curves || []), ...(panel.bands || [])])
      if (curve.name && !names.has(curve.name)) names.set(curve.name, curve);
    this.names = names;
    const legend = element("div", { class: "legend", role: "group", "aria-label": "curves" }, this.bar);
    for (const [name, curve] of names) {
      const button = element("button", { type: "button", "aria-pressed": "true", title: `${name}: show or hide` }, legend);
      const sample = make("svg", { width: 20, height: 10, "aria-hidden": "true" }, button);
      this.sample(curve, 0, 5, sample);
      element("span", {}, button, name);
      button.addEventListener("click", () => {
        const on = button.getAttribute("aria-pressed") === "true";
        button.setAttribute("aria-pressed", String(!on));
        if (on) this.hidden.add(name); else this.hidden.delete(name);
        this.draw();
      });
    }
    const tools = element("div", { class: "tools", role: "group", "aria-label": "chart" }, this.bar);
    const tool = (text, title, act) => element("button", { type: "button", title }, tools, text).addEventListener("click", act);
    this.chart.panels.forEach((panel, k) => {
      if (panel.kind !== "polar") return;
      const label = element("label", { class: "magnify" }, tools, "magnification ");
      this.slider = element("input", { type: "range", min: "-3", max: String(this.most_doublings(panel)), step: "0.25", value: "0", "aria-label": "magnification of the radius deviation" }, label);
      this.times = element("output", {}, label);
      this.slider.addEventListener("input", () => {
        this.reaches[k] = panel.ring * panel.rings / 2 ** Number(this.slider.value);
        this.draw();
      });
    });
    tool("Reset", "back to the whole chart", () => this.back());
    tool("PNG", "save the picture as PNG", () => this.save_png());
    tool("SVG", "save the picture as SVG", () => this.save("svg", new Blob([this.picture()], { type: "image/svg+xml" })));
    tool("CSV", "save the curves as CSV", () => this.save("csv", new Blob([this.csv()], { type: "text/csv" })));
  }

  // How often the deviations may be doubled: until half of a curve has left the rings, or one has come near the centre.
  most_doublings(panel) {
    const gap = RING_GAPS[panel.rings] * panel.rings;
    const needed = panel.curves.map(curve => {
      const sizes = Array.from(values(curve.y)).filter(Number.isFinite).map(Math.abs).sort((a, b) => a - b);
      const inwards = -values(curve.y).reduce((least, entry) => Number.isFinite(entry) ? Math.min(least, entry) : least, 0);
      return sizes.length ? Math.max(sizes[sizes.length >> 1] / (1 + 0.16), inwards * gap / 0.9) : 0;
    });
    const most = Math.log2(panel.ring * panel.rings / Math.max(...needed, 1e-9));
    return Math.min(5, Math.max(0, Math.floor(4 * most) / 4));
  }

  sample(curve, x, y, parent) {
    if (curve.low !== undefined || curve.filled) make("rect", { x, y: y - 4, width: 20, height: 8, fill: colour(curve.colour), "fill-opacity": curve.filled ? 0.5 : 0.2 }, parent);
    else if (curve.dots) make("circle", { cx: x + 10, cy: y, r: Math.max(2.4, curve.width), fill: colour(curve.colour) }, parent);
    else make("line", { ...styled(curve), x1: x, x2: x + 20, y1: y, y2: y, "stroke-width": Math.max(1.6, curve.width) }, parent);
  }

  draw(width = this.width || this.room.clientWidth || document.querySelector("main")?.clientWidth || 960, tall = 0) {
    this.width = width = Math.max(width, 200);
    tall ||= this.fitting(width);
    const { boxes, height } = placed(this.chart, width, tall), title = this.figure.dataset.title;
    const svg = make("svg", { class: "chart", viewBox: `0 0 ${width} ${Math.ceil(height)}`, role: "group", "aria-roledescription": "chart", tabindex: "0",
      "aria-label": `${title}. ${[...this.names.keys()].join(", ")}. ${KEYS}`, "font-family": FONT, "font-size": 12 });
    const frames = frames_of(this.chart.panels, boxes, values, this.hidden, this.zooms);
    this.drawn = this.chart.panels.map((panel, k) => {
      const id = `${this.stem}-clip-${k}`;
      if (panel.kind === "polar") return draw_polar(panel, boxes[k], svg, values, this.hidden, this.reaches[k], id);
      if (panel.kind === "grid") return draw_grid(panel, boxes[k], svg, values);
      return draw_panel(panel, boxes[k], svg, values, this.hidden, frames[k], id);
    });
    this.over = make("g", { "pointer-events": "none" }, svg);
    const focused = this.svg && this.svg === document.activeElement;
    if (this.svg) this.svg.replaceWith(svg); else this.field.prepend(svg);
    this.svg = svg;
    if (focused) svg.focus({ preventScroll: true });
    this.listen();
    const polar = this.drawn.find(entry => entry.panel.kind === "polar");
    if (polar) {
      const { rings, radius } = polar.panel, times = RING_GAPS[rings] * rings / polar.reach * radius * 1e3;
      this.times.textContent = `${Number(times.toPrecision(3)).toLocaleString("en")}×`;
    }
    if (this.cursor) this.point(this.cursor.panel, this.cursor.x, true);
  }

  // The picture of the first screen ends with it: its panels are lower where the screen is.
  fitting(width) {
    if (!this.figure.classList.contains("lead")) return 1;
    const room = Math.max(innerHeight, 600) - (this.field.getBoundingClientRect().top + scrollY) - BELOW;
    return [1, 0.9, 0.8, 0.7, 0.6, 0.5].find(tall => placed(this.chart, width, tall).height < room) || 0.45;
  }

  back() {
    this.zooms = this.chart.panels.map(() => ({ x: null, y: null }));
    this.chart.panels.forEach((panel, k) => { if (panel.kind === "polar") { this.reaches[k] = panel.ring * panel.rings; this.slider.value = "0"; } });
    this.draw();
  }

  // Zoom a panel, and those that are linked with it along their abscissae; no further than the curves have digits.
  zoom(k, x, y) {
    const own = this.chart.panels[k], linked = own.linked;
    [x, y] = [x && wide_enough(x, own.x), y && wide_enough(y, own.y)];
    this.chart.panels.forEach((panel, j) => {
      if (j === k) this.zooms[j] = { x, y };
      else if (linked && panel.linked === linked) this.zooms[j] = { x, y: null };
    });
    this.draw();
  }

  at(event) {
    const seen = this.svg.getBoundingClientRect(), per = this.width / seen.width;
    const x = (event.clientX - seen.left) * per, y = (event.clientY - seen.top) * per;
    const k = this.drawn.findIndex(({ panel, box, inner }) => {
      const a = x - box.x, b = y - box.y;
      return panel.kind === "polar" ? a >= 0 && b >= 0 && a <= box.width && b <= box.height
        : inner && a >= inner.x - 6 && a <= inner.x + inner.width + 6 && b >= inner.y - 4 && b <= inner.y + inner.height + 4;
    });
    return k < 0 ? null : { k, x: x - this.drawn[k].box.x, y: y - this.drawn[k].box.y };
  }

  listen() {
    let from = null;
    const shade = make("rect", { fill: colour("blue"), "fill-opacity": 0.15, visibility: "hidden" }, this.over);
    this.svg.addEventListener("pointerdown", event => {
      from = event.button === 0 ? this.at(event) : null;
      if (from && this.drawn[from.k].panel.kind === "xy") this.svg.setPointerCapture(event.pointerId); else from = null;
    });
    this.svg.addEventListener("pointermove", event => {
      const to = from ? this.within(event, from.k) : this.at(event);
      if (!to) return this.leave();
      if (from) {
        const { box, inner } = this.drawn[from.k], [x0, x1] = [from.x, to.x].sort((a, b) => a - b), [y0, y1] = [from.y, to.y].sort((a, b) => a - b);
        const tall = y1 - y0 > 24;
        shade.setAttribute("visibility", x1 - x0 > 4 || tall ? "visible" : "hidden");
        const room = { x: box.x + x0, y: box.y + (tall ? y0 : inner.y), width: x1 - x0, height: tall ? y1 - y0 : inner.height };
        for (const key in room) shade.setAttribute(key, room[key]);
      }
      const { panel, across, centre } = this.drawn[to.k];
      if (panel.kind === "polar") this.point(to.k, (Math.atan2(centre[1] - to.y, to.x - centre[0]) * 180 / Math.PI + 360) % 360, false);
      else this.point(to.k, across.back(to.x), false, to);
      return undefined;
    });
    this.svg.addEventListener("pointerup", event => {
      if (!from) return;
      const start = from, to = this.within(event, from.k), { across, up } = this.drawn[start.k];
      from = null;
      shade.setAttribute("visibility", "hidden");
      const sorted = (scaled, a, b) => [scaled.back(a), scaled.back(b)].sort((p, q) => p - q);
      if (Math.abs(to.x - start.x) > 6) this.zoom(start.k, sorted(across, start.x, to.x), Math.abs(to.y - start.y) > 24 ? sorted(up, start.y, to.y) : null);
    });
    this.svg.addEventListener("pointerleave", () => { if (!from) this.leave(); });
    this.svg.addEventListener("dblclick", () => this.back());
    this.svg.addEventListener("keydown", event => this.key(event));
    this.svg.addEventListener("blur", () => { this.cursor = null; this.leave(); });
  }

  within(event, k) {
    const seen = this.svg.getBoundingClientRect(), per = this.width / seen.width, { box, inner } = this.drawn[k];
    const kept = (value, low, size) => Math.min(Math.max(value, low), low + size);
    return { k, x: kept((event.clientX - seen.left) * per - box.x, inner.x, inner.width), y: kept((event.clientY - seen.top) * per - box.y, inner.y, inner.height) };
  }

  leave() {
    while (this.over.childNodes.length > 1) this.over.lastChild.remove();
    this.readout.hidden = true;
  }

  // Values of all panels linked with one at an abscissa; of loops the point nearest to the pointer.
  point(k, x, spoken, pointer = null) {
    this.leave();
    const own = this.chart.panels[k], linked = own.kind === "polar" ? "angle" : own.linked, lines = [];
    let head = "";
    this.drawn.forEach((entry, j) => {
      const { panel, box, inner, across, up, shown } = entry;
      const polar = panel.kind === "polar" && linked === "angle";
      if (j !== k && !(polar || (linked && panel.linked === linked))) return;
      if (panel.kind === "xy") {
        const at = across(x);
        if (at >= inner.x - 1 && at <= inner.x + inner.width + 1 && panel.curves.some(curve => curve.ascending))
          make("line", { x1: box.x + at, x2: box.x + at, y1: box.y + inner.y, y2: box.y + inner.y + inner.height, stroke: colour("ink"), "stroke-width": 0.8, "stroke-opacity": 0.6 }, this.over);
      }
      for (const curve of shown) {
        const xs = values(curve.x), ys = values(curve.y);
        let row = -1, spot = null;
        if (panel.kind === "polar") {
          let least = Infinity;
          for (let i = 0; i < xs.length; i++) { const off = Math.abs(((xs[i] * 180 / Math.PI - x) % 360 + 540) % 360 - 180); if (off < least) { least = off; row = i; } }
          if (row >= 0) spot = entry.place(xs[row], ys[row]);
        } else if (curve.ascending && !curve.dots) {
          row = nearest(xs, x);
          if (!Number.isFinite(ys[row]) || x < xs[0] - 1e-9 * Math.abs(xs[0]) || x > xs[xs.length - 1] * (1 + 1e-9)) continue;
          spot = [across(xs[row]), up(ys[row])];
        } else if (pointer && j === k) {
          let least = 900;
          for (let i = 0; i < xs.length; i++) { const off = (across(xs[i]) - pointer.x) ** 2 + (up(ys[i]) - pointer.y) ** 2; if (off < least) { least = off; row = i; } }
          if (row >= 0) spot = [across(xs[row]), up(ys[row])];
        }
        if (row < 0 || !spot) continue;
        make("circle", { cx: box.x + spot[0], cy: box.y + spot[1], r: 3.4, fill: colour(curve.colour), stroke: colour("ground"), "stroke-width": 1 }, this.over);
        if (panel.kind === "polar") { if (j === k) lines.push([curve, `${written_at(curve.y, row, [-entry.reach, entry.reach])} µm`, panel.title]); continue; }
        const loop = !curve.ascending || curve.dots, name = axis => axis.names.length ? axis.names[Math.round(xs[row])] : null;
        const value = panel.y.names.length ? panel.y.names[Math.round(ys[row])] ?? "" : `${written_at(curve.y, row, entry.height)}${unit_of(panel.y)}`;
        lines.push([curve, loop ? `${value} at ${name(panel.x) ?? written_at(curve.x, row, entry.span) + unit_of(panel.x)}` : value, panel.y.label]);
        if (!loop && j === k && !head) head = `${panel.x.label} ${name(panel.x) ?? written_at(curve.x, row, entry.span) + unit_of(panel.x)}`;
      }
    });
    if (own.kind === "polar") head = `angle ${number(x, 4)}°`;
    if (!lines.length) return;
    this.tell(head, lines, k, x, pointer);
    if (spoken) this.spoken.textContent = [head, ...lines.map(([curve, value, of]) => `${of}, ${curve.name}: ${value}`)].join("; ");
  }

  tell(head, lines, k, x, pointer) {
    this.readout.replaceChildren();
    if (head) element("b", {}, this.readout, head);
    const several = new Set(lines.map(line => line[2])).size > 1;
    let of = "";
    for (const [curve, value, what] of lines) {
      if (several && what !== of) element("i", {}, this.readout, of = what);
      const row = element("div", {}, this.readout);
      const sample = make("svg", { width: 20, height: 10, "aria-hidden": "true" }, row);
      this.sample(curve, 0, 5, sample);
      element("span", {}, row, ` ${curve.name ? `${curve.name}: ` : ""}${value}`);
    }
    this.readout.hidden = false;
    const { box, across, inner, place } = this.drawn[k], scaled = this.svg.getBoundingClientRect().width / this.width;
    const [a, b] = place ? place(x * Math.PI / 180, 0) : [pointer ? pointer.x : across(x), pointer ? pointer.y : inner.y + 20];
    const left = (box.x + a) * scaled, size = this.readout.offsetWidth;
    this.readout.style.left = `${Math.max(0, left + 16 + size > this.room.clientWidth ? left - 16 - size : left + 16)}px`;
    this.readout.style.top = `${Math.max(0, (box.y + b) * scaled - 12)}px`;
  }

  key(event) {
    const usable = this.drawn.map((entry, k) => entry.panel.kind === "grid" ? -1 : k).filter(k => k >= 0);
    if (!usable.length || event.ctrlKey || event.altKey || event.metaKey) return;
    const k = this.cursor ? this.cursor.panel : usable[0], { panel, span, across, inner } = this.drawn[k], polar = panel.kind === "polar";
    const middle = polar ? 0 : across.back(inner.x + inner.width / 2);
    const x = this.cursor ? this.cursor.x : middle, turn = usable.indexOf(k);
    const moved = by => polar ? (x + 3 * by + 360) % 360 : Math.min(Math.max(across.back(across(x) + by * inner.width / 100), span[0]), span[1]);
    const scaled = by => {
      if (polar) { this.slider.value = String(Number(this.slider.value) + by); return this.slider.dispatchEvent(new Event("input")); }
      const at = across(x), half = inner.width / 2 * 2 ** -by, whole = whole_span(panel, values);
      return this.zoom(k, [Math.max(whole[0], across.back(at - half)), Math.min(whole[1], across.back(at + half))], null);
    };
    const acts = {
      ArrowLeft: () => this.go(k, moved(event.shiftKey ? -10 : -1)), ArrowRight: () => this.go(k, moved(event.shiftKey ? 10 : 1)),
      PageDown: () => this.go(usable[(turn + 1) % usable.length], null), PageUp: () => this.go(usable[(turn + usable.length - 1) % usable.length], null),
      "+": () => scaled(1), "-": () => scaled(-1), 0: () => this.back(), Escape: () => { this.cursor = null; this.leave(); },
    };
    if (acts[event.key]) { event.preventDefault(); acts[event.key](); }
  }

  go(k, x) {
    const { panel, across, inner } = this.drawn[k];
    this.cursor = { panel: k, x: x ?? (panel.kind === "polar" ? 0 : across.back(inner.x + inner.width / 2)) };
    this.point(k, this.cursor.x, true);
  }

  // The picture by itself: colours as on paper, title and legend above.
  picture() {
    const copy = this.svg.cloneNode(true), head = make("g"), width = this.width;
    copy.lastChild.remove();
    make("text", { x: 4, y: 18, "font-size": 14, "font-weight": 600, fill: colour("ink") }, head, this.figure.dataset.title);
    let x = 4, y = 38;
    for (const [name, curve] of this.names) {
      if (this.hidden.has(name)) continue;
      const room = 34 + 6.8 * name.length;
      if (x + room > width && x > 4) { x = 4; y += 18; }
      this.sample(curve, x, y - 4, head);
      make("text", { x: x + 25, y, fill: colour("ink") }, head, name);
      x += room;
    }
    const top = y + 10, height = Number(this.svg.getAttribute("viewBox").split(" ")[3]) + top, all = make("g", { transform: `translate(0 ${top})` });
    all.append(...copy.childNodes);
    copy.append(make("rect", { width, height, fill: colour("ground") }), head, all);
    for (const name of ["tabindex", "class", "aria-label", "aria-roledescription", "role"]) copy.removeAttribute(name);
    for (const [name, value] of Object.entries({ viewBox: `0 0 ${width} ${height}`, width, height })) copy.setAttribute(name, value);
    return new XMLSerializer().serializeToString(copy).replace(/var\(--(\w+)\)/g, (whole, name) => DATA.palette[name]);
  }

  save_png() {
    const image = new Image();
    image.onload = () => {
      const canvas = document.createElement("canvas");
      canvas.width = 2 * image.width;
      canvas.height = 2 * image.height;
      canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
      canvas.toBlob(blob => this.save("png", blob));
    };
    image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(this.picture())}`;
  }

  // Curves side by side, those of the same abscissae behind one column of them.
  csv() {
    const columns = [], quoted = text => `"${text.replaceAll('"', '""')}"`;
    this.chart.panels.forEach(panel => {
      if (panel.kind === "grid") {
        const cells = values(panel.values), n = panel.columns.length;
        columns.push(["", panel.rows], ...panel.columns.map((name, j) => [name, panel.rows.map((row, i) => cells[i * n + j])]));
        return;
      }
      let last = null;
      for (const curve of panel.curves) {
        if (this.hidden.has(curve.name)) continue;
        const [x, y] = panel.kind === "polar" ? ["angle [rad]", "radius deviation [µm]"] : [label_of(panel.x), label_of(panel.y)];
        if (curve.x !== last) columns.push([x, values(last = curve.x), last]);
        columns.push([[panel.title, curve.name, y].filter(entry => entry).join(", "), values(curve.y), curve.y]);
      }
    });
    const rows = [columns.map(([name]) => quoted(name)).join(",")];
    const cell = (value, array, row) => value === undefined || Number.isNaN(value) ? "" : typeof value === "string" ? quoted(value)
      : String(array === null ? value : Number(value.toPrecision(counting(array, row))));
    for (let k = 0, n = Math.max(0, ...columns.map(([, column]) => column.length)); k < n; k++) rows.push(columns.map(([, column, array = null]) => cell(column[k], array, k)).join(","));
    return rows.join("\n") + "\n";
  }

  save(kind, blob) {
    const link = element("a", { href: URL.createObjectURL(blob), download: `${this.stem}.${kind}` }, this.room);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  }
}

// What is in sight is drawn at once, the others when there is time; until then their still pictures stand there.
const lives = [], waiting = [...document.querySelectorAll("figure.chart")];
const BELOW = 40; // room for what stands below the picture of the first screen
const in_sight = figure => figure.getClientRects().length && figure.getBoundingClientRect().top < innerHeight;
const begin = figure => { const live = new Live(figure); lives.push(live); live.draw(); };
const later = window.requestIdleCallback || (act => setTimeout(act, 1));
const go_on = () => { if (waiting.length) { begin(waiting.shift()); later(go_on); } };
while (waiting.length && in_sight(waiting[0])) begin(waiting.shift());
later(go_on);
let frame = 0;
addEventListener("resize", () => {
  cancelAnimationFrame(frame);
  frame = requestAnimationFrame(() => { for (const live of lives) if (live.room.clientWidth !== live.width) live.draw(live.room.clientWidth || live.width); });
});
// On paper panels stand side by side, however narrow the sheet is: it is read from nearer than a screen. They are lower
// where the chart would else leave the rest of a sheet empty.
const SHEET = 0.9; // height of a chart against its width
addEventListener("beforeprint", () => {
  cancelAnimationFrame(frame); // of a window that was resized a moment ago
  while (waiting.length) begin(waiting.shift());
  for (const live of lives) {
    const width = Math.max(720, COLUMN * live.chart.widths.length);
    live.draw(width, [1, 0.85, 0.7].find(tall => placed(live.chart, width, tall).height < SHEET * width) || 0.6);
  }
});
addEventListener("afterprint", () => {
  for (const live of lives) live.draw(live.room.clientWidth || undefined);
});
// What is unfolded is drawn as wide as it is then; a link into what is folded opens it.
document.addEventListener("toggle", event => {
  for (const live of lives) if (event.target.contains(live.room) && live.room.clientWidth && live.room.clientWidth !== live.width) live.draw(live.room.clientWidth);
}, true);
const unfold = () => {
  const asked = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  for (let part = asked; part; part = part.parentElement) if (part.tagName === "DETAILS") part.open = true;
  if (asked) asked.scrollIntoView();
};
addEventListener("hashchange", unfold);
unfold();
