// Draws charts (feedsim.report.chart) as SVG: panels, polar panels, grids. Colours are the page's CSS variables, so that
// one drawing serves light, dark and paper. chart_scale.js has what it computes with,
// chart_use.js what a reader does with the charts.

// The title of a panel, as small as its room makes it.
function headed(text, x, room, parent) {
  const size = Math.min(12, 12 * room / (7.6 * text.length || 1));
  make("text", { x, y: 15, "font-weight": 600, "font-size": size.toFixed(1), fill: colour("ink") }, parent, text);
}

const width_of = text => Math.max(...text.split("\n").map(line => LETTER * line.length)) + 2;

// What the curves and labels of a panel cover, in cells: words are put where nothing is.
class Taken {
  constructor(inner) {
    this.inner = inner;
    this.across = Math.ceil(inner.width / BLOCK);
    this.cells = new Uint8Array(this.across * Math.ceil(inner.height / BLOCK));
  }

  box(x, y, wide, tall) {
    for (let b = y; b < y + tall + BLOCK; b += BLOCK) for (let a = x; a < x + wide + BLOCK; a += BLOCK) this.dot(Math.min(a, x + wide), Math.min(b, y + tall));
  }

  dot(x, y) {
    const { inner } = this;
    if (x < inner.x || x >= inner.x + inner.width || y < inner.y || y >= inner.y + inner.height) return;
    this.cells[Math.floor((y - inner.y) / BLOCK) * this.across + Math.floor((x - inner.x) / BLOCK)] = 1;
  }

  path(d, dots) {
    let last = null;
    for (const [, pen, a, b] of d.matchAll(/([ML])(\S+) ([^ML]+)/g)) {
      const point = [Number(a), Number(b)];
      const steps = pen === "L" && last && !dots ? Math.min(500, Math.ceil(Math.hypot(point[0] - last[0], point[1] - last[1]) / 3)) : 1;
      for (let k = 1; k <= steps; k++) this.dot(...(steps > 1 ? point.map((entry, j) => last[j] + (entry - last[j]) * k / steps) : point));
      last = point;
    }
  }

  // The place {x, y of the first line's foot, far} that covers least and is least far; it is taken then.
  put(text, places) {
    const { inner } = this, wide = width_of(text), tall = 12 + 15 * (text.split("\n").length - 1);
    const cost = ({ x, y, far }) => {
      if (y - 10 < inner.y || y - 10 + tall > inner.y + inner.height || x < inner.x || x + wide > inner.x + inner.width + 1) return 1e6 + far;
      let covered = 0;
      for (let b = y - 10; b <= y - 10 + tall; b += BLOCK) for (let a = x; a <= x + wide; a += BLOCK)
        covered += this.cells[Math.floor((b - inner.y) / BLOCK) * this.across + Math.floor((a - inner.x) / BLOCK)] || 0;
      return far + (covered ? 120 + 10 * covered : 0);
    };
    const costs = places.map(cost), best = places[costs.indexOf(costs.reduce((least, entry) => Math.min(least, entry), Infinity))] || { x: inner.x + 4, y: inner.y + 12 };
    this.box(best.x, best.y - 10, wide, tall);
    return best;
  }
}

// What a panel shows of its curves, its ticks upwards, and the room that these need at the left.
function frame_of(panel, box, values, hidden, zoom) {
  const shown = panel.curves.filter(entry => !hidden.has(entry.name));
  let span = zoom.x || whole_span(panel, values);
  let height = zoom.y || (!zoom.x && panel.y.span) || range_of(panel, shown, values, span);
  const above = top_of(panel), tall = box.height - above - BOTTOM;
  const ticked = () => ticks(panel.y, height[0], height[1], panel.y.names.length || Math.max(2, Math.floor(tall / TICK_HEIGHT)));
  let heights = ticked();
  const widest_of = (texts, wide, more) => texts.reduce((most, entry) => Math.max(most, wide * entry.length + more), 0);
  const beside = panel.y.names.length ? widest_of(panel.y.names, 6.6, 26) : widest_of(heights.map(entry => entry.text || ""), 6.6, 30);
  const left = Math.min(Math.max(LEFT, beside), box.width * 0.45);
  if (panel.equal) { // a unit is as long on both axes
    const wide = box.width - left - box.aside, unit = Math.max((span[1] - span[0]) / wide, (height[1] - height[0]) / tall);
    [span, height] = [[span, wide], [height, tall]].map(([[low, high], size]) => [(low + high - unit * size) / 2, (low + high + unit * size) / 2]);
    heights = ticked();
  }
  return { shown, span, height, above, tall, heights, widest_of, left };
}

// The frames of all panels; those below one another begin alike.
function frames_of(panels, boxes, values, hidden, zooms) {
  const frames = panels.map((panel, k) => panel.kind === "xy" ? frame_of(panel, boxes[k], values, hidden, zooms[k]) : null);
  frames.forEach((entry, k) => {
    if (entry) entry.shared = Math.max(...frames.map((other, j) => other && boxes[j].x === boxes[k].x && boxes[j].width === boxes[k].width ? other.left : 0));
  });
  return frames;
}

// What stands upright beside a panel: in two lines where one is longer than the panel, smaller where these are, too.
// x: of the foot of the outermost line, at the left or (right) at the right.
function upright(text, x, inner, most, parent, right = false) {
  const spaces = [...text.matchAll(/ /g)].map(entry => entry.index), middle = text.length / 2;
  const cut = 6.4 * text.length > inner.height && spaces.length ? spaces.reduce((best, entry) => Math.abs(entry - middle) < Math.abs(best - middle) ? entry : best) : text.length;
  const lines = [text.slice(0, cut), text.slice(cut + 1)].filter(Boolean), longest = Math.max(...lines.map(entry => entry.length));
  const size = Math.max(8, Math.min(12, 12 * most / (6.4 * longest)));
  lines.forEach((line, k) => make("text", { transform: `translate(${x + LINE_PITCH * size * (right ? k + 1 - lines.length : k - (lines.length - 1) / 6)} ${inner.y + inner.height / 2}) rotate(-90)`,
    "text-anchor": "middle", fill: colour("ink"), ...(size < 12 ? { "font-size": size.toFixed(1) } : {}) }, parent, line));
}

// One panel into box = {x, y, width, height}; returns its scales and ranges.
function draw_panel(panel, box, parent, values, hidden, frame, id) {
  const part = make("g", { transform: `translate(${box.x} ${box.y})` }, parent);
  const { shown, span, height, above, tall, heights, widest_of, shared: left } = frame;
  const inner = { x: left, y: above, width: box.width - left - box.aside, height: tall };
  const across = scale(span[0], span[1], inner.x, inner.x + inner.width, panel.x);
  const up = scale(height[0], height[1], inner.y + inner.height, inner.y, panel.y);
  const bottom = inner.y + inner.height, right = inner.x + inner.width;
  const title = panel.y.names.length ? 0 : Math.max(0, Math.min(inner.x, box.width - 7.4 * panel.title.length));
  headed(panel.title, title, box.width - title, part);
  const widest = Math.max(TICK_WIDTH, widest_of(panel.x.names, 7, 14));
  const along = apart(most => ticks(panel.x, span[0], span[1], most), across, Math.max(2, Math.floor(inner.width / widest)), box.width);
  for (const tick of along) {
    const at = across(tick.at).toFixed(1);
    make("line", { x1: at, x2: at, y1: inner.y, y2: bottom, stroke: colour("grid"), "stroke-width": tick.text ? 0.8 : 0.35 }, part);
    const seen = Math.min(at, box.width - 3.6 * tick.text.length); // the last one stays inside
    if (tick.text) make("text", { x: seen, y: bottom + 16, "text-anchor": "middle", fill: colour("ink") }, part, tick.text);
  }
  for (const tick of heights) {
    const at = up(tick.at).toFixed(1);
    make("line", { x1: inner.x, x2: right, y1: at, y2: at, stroke: colour("grid"), "stroke-width": tick.text ? 0.8 : 0.35 }, part);
    if (tick.text) make("text", { x: inner.x - 6, y: +at + 4, "text-anchor": "end", fill: colour("ink") }, part, tick.text);
  }
  make("text", { x: Math.min(inner.x + inner.width / 2, box.width - 3.4 * title_of(panel.x, along).length), y: bottom + 34, "text-anchor": "middle", fill: colour("ink") }, part, title_of(panel.x, along));
  if (!panel.y.names.length)
    upright(title_of(panel.y, heights), 13, inner, box.height - 8, part);
  if (panel.x.also) {
    const [label, unit, factor] = panel.x.also, named = { label, unit, log: panel.x.log, names: [] };
    const result = apart(most => ticks(named, span[0] * factor, span[1] * factor, most), at => across(at / factor), Math.max(2, Math.floor(inner.width / TICK_WIDTH)));
    for (const tick of result)
      if (tick.text) make("text", { x: across(tick.at / factor), y: inner.y - 5, "text-anchor": "middle", fill: colour("ink") }, part, tick.text);
    make("text", { x: inner.x + inner.width / 2, y: inner.y - 20, "text-anchor": "middle", fill: colour("ink") }, part, title_of(named, result));
  }
  if (panel.y.also) {
    const [label, unit, factor] = panel.y.also, named = { label, unit, log: panel.y.log, names: [] };
    const result = ticks(named, height[0] * factor, height[1] * factor, Math.max(2, Math.floor(tall / TICK_HEIGHT)));
    for (const tick of result)
      if (tick.text) make("text", { x: right + 6, y: up(tick.at / factor) + 4, fill: colour("ink") }, part, tick.text);
    upright(title_of(named, result), box.width - 5, inner, box.height - 8, part, true);
  }
  const clip = make("clipPath", { id }, part);
  make("rect", { x: inner.x, y: inner.y, width: inner.width, height: inner.height }, clip);
  const field = make("g", { "clip-path": `url(#${id})` }, part);
  const top = make("g", { "clip-path": `url(#${id})` }), labelled = [];
  for (const band of panel.bands) {
    if (band.name && hidden.has(band.name)) continue;
    const x = band.x === null ? span : values(band.x);
    const edge = which => typeof band[which] === "number" ? Array(x.length).fill(band[which]) : values(band[which].array);
    const low = edge("low"), high = edge("high"), points = [];
    const inside = value => Math.min(Math.max(Number.isFinite(value) ? up(value) : bottom, -1e4), 1e4).toFixed(1);
    for (let k = 0; k < x.length; k++) points.push(`${across(x[k]).toFixed(1)} ${inside(high[k])}`);
    for (let k = x.length - 1; k >= 0; k--) points.push(`${across(x[k]).toFixed(1)} ${inside(low[k])}`);
    make("path", { d: `M${points.join("L")}Z`, fill: colour(band.colour), "fill-opacity": BAND }, field);
  }
  for (const level of panel.levels) {
    const look = { stroke: colour(level.colour), "stroke-width": 1, ...(level.dash ? { "stroke-dasharray": DASHES[level.dash] } : {}) };
    const at = (level.upright ? across : up)(level.at);
    if (!Number.isFinite(at)) continue;
    const ends = level.ends ? level.ends.map(level.upright ? up : across) : level.upright ? [inner.y, bottom] : [inner.x, right];
    make("line", level.upright ? { x1: at, x2: at, y1: ends[0], y2: ends[1], ...look } : { x1: ends[0], x2: ends[1], y1: at, y2: at, ...look }, field);
    if (level.text) labelled.push([level, at]);
  }
  make("rect", { x: inner.x, y: inner.y, width: inner.width, height: inner.height, fill: "none", stroke: colour("muted"), "stroke-width": 0.8 }, part);
  const words = labelled.length || panel.note || panel.marks.some(mark => mark.text), taken = words ? new Taken(inner) : null;
  for (const curve of [...shown].sort((a, b) => b.dots - a.dots)) { // a line through its points, not below them
    const x = values(curve.x), y = values(curve.y);
    let d = path_of(x, y, across, up, curve.ascending && !curve.filled && !curve.dots ? span : null, inner.width);
    if (!d) continue;
    if (taken) taken.path(d, curve.dots);
    if (curve.dots) make("path", { ...styled(curve), d: d.replace(/[LM]/g, "h0M").slice(2) + "h0", "stroke-width": 2 * curve.width, "stroke-linecap": "round" }, field);
    else if (curve.filled) {
      const zero = Math.min(bottom, up(panel.y.log ? height[0] : 0)).toFixed(1);
      make("path", { d: `${d}V${zero}H${across(x[0]).toFixed(1)}Z`, fill: colour(curve.colour), "fill-opacity": FILL }, field);
    } else make("path", { ...styled(curve), d }, field);
  }
  part.append(top);
  const marks = panel.marks.map(mark => [mark, across(mark.x), up(mark.y)]).filter(([, x]) => x >= inner.x - 1 && x <= right + 1);
  for (const [mark, x, y] of marks) {
    make("circle", { cx: x, cy: y, r: 3.6, fill: mark.hollow ? "none" : colour(mark.colour), stroke: colour(mark.colour), "stroke-width": 1.4 }, field);
    if (taken) taken.box(x - 4, y - 4, 8, 8);
  }
  const label = (text, places, parent, look = {}) => {
    const place = taken.put(text, places);
    make("text", { x: place.x, y: place.y, ...HALO, ...look }, parent, text);
    return place;
  };
  if (taken) for (const level of panel.levels) if (!level.upright && !level.text) taken.box(inner.x, up(level.at), inner.width, 0);
  for (const [mark, x, y] of marks) {
    if (!mark.text) continue;
    const wide = width_of(mark.text), places = [];
    for (let k = -9; k <= 9; k++) for (const [from, far] of [[x + 7, 0], [x - 7 - wide, 2], [x - wide / 2, 4], [x - 1.6 * wide, 40], [x + 0.6 * wide, 40]])
      places.push({ x: Math.min(Math.max(from, inner.x + 3), right - wide - 3), y: y - 6 + 13 * k, far: far + Math.abs(13 * k) });
    const place = label(mark.text, places, part);
    const to = [Math.min(Math.max(x, place.x), place.x + wide), place.y < y ? place.y + 3 : place.y - 10];
    if (Math.hypot(to[0] - x, to[1] - y) > LEADER) make("line", { x1: x, y1: y, x2: to[0], y2: to[1], stroke: colour("muted"), "stroke-width": 0.7 }, field);
  }
  for (const [level, at] of labelled) {
    const wide = width_of(level.text), places = [];
    if (level.upright) for (let y = inner.y + 12; y < bottom - 4; y += 13) places.push({ x: at + 4, y, far: y - inner.y }, { x: at - 4 - wide, y, far: y - inner.y + 3 });
    else {
      const ends = level.ends ? level.ends.map(end => Math.min(Math.max(across(end), inner.x), right)) : [inner.x, right], last = Math.max(Math.min(ends[1], right) - 4 - wide, inner.x + 4);
      for (let x = last; x >= Math.min(ends[0] + 4, last); x -= 12) for (const k of [0, 1, 2])
        places.push({ x, y: at - 4 - 12 * k, far: 0.2 * (last - x) + 12 * k }, { x, y: at + 12 + 12 * k, far: 0.2 * (last - x) + 12 * k + 3 });
    }
    label(level.text, places, top, { fill: colour("muted") });
  }
  if (panel.note) {
    const lines = panel.note.split("\n"), wide = Math.max(...lines.map(width_of)), low = bottom - 8 - 15 * (lines.length - 1), high = inner.y + 16;
    const places = []; // the lower left, another corner, else somewhere between
    for (let y = high; y <= low; y += 15) for (const [x, far] of [[inner.x + 8, 0], [right - 8 - wide, 1]]) places.push({ x, y, far: far + 3 + Math.min(low - y, y - high) });
    places.push({ x: inner.x + 8, y: low, far: 0 }, { x: right - 8 - wide, y: low, far: 1 });
    const place = taken.put(panel.note, places);
    lines.forEach((line, k) => make("text", { x: place.x, y: place.y + 15 * k, ...HALO }, part, line));
  }
  return { panel, box, inner, across, up, span, height, shown, part };
}

// Deviations about the programmed circle. reach: deviation [um] of the outermost ring.
function draw_polar(panel, box, parent, values, hidden, reach, id) {
  const part = make("g", { transform: `translate(${box.x} ${box.y})` }, parent);
  const gap = RING_GAPS[panel.rings] * panel.rings, outer = 1 + OUTER_RADIUS * gap;
  const half = Math.min(box.width, box.height - 24) / 2 - 20, centre = [box.width / 2, 24 + (box.height - 24) / 2];
  const one = half / outer;
  const radius = deviation => one * Math.max(0, Math.min(2 * outer, 1 + deviation / reach * gap));
  const place = (angle, deviation) => [centre[0] + radius(deviation) * Math.cos(angle), centre[1] - radius(deviation) * Math.sin(angle)];
  make("text", { x: 4, y: 15, "font-weight": 600, fill: colour("ink") }, part, panel.title);
  const step = step_of(reach / 2.4);
  const ring = (deviation, look) => make("circle", { cx: centre[0], cy: centre[1], r: radius(deviation).toFixed(1), fill: "none", ...look }, part);
  const count = Math.floor(reach / step + 1e-9);
  for (let k = -count; k <= count; k++) if (k) ring(k * step, { stroke: colour("grid"), "stroke-width": 0.9 });
  panel.axes.forEach((axis, k) => {
    for (const sign of [1, -1]) {
      const x = k ? 0 : sign, y = k ? -sign : 0;
      make("line", { x1: centre[0], y1: centre[1], x2: centre[0] + half * x, y2: centre[1] + half * y, stroke: colour("grid"), "stroke-width": 0.9 }, part);
      make("text", { x: centre[0] + (half + 11) * x, y: centre[1] + (half + 11) * y + 4, "text-anchor": "middle", "font-weight": 600, fill: colour("ink") }, part, axis + (sign > 0 ? "+" : "−"));
    }
  });
  ring(0, { stroke: colour("muted"), "stroke-width": 1.1, "stroke-dasharray": "7 4" });
  const words = make("g", { ...HALO, fill: colour("muted"), "font-size": 10.5 });
  for (let k = -count; k <= count; k++) {
    const at = radius(k * step) * Math.SQRT1_2;
    if (k && k < count && half < 190) continue; // on a phone the labels of points need the room
    make("text", { x: centre[0] + at, y: centre[1] - at + 4, "text-anchor": "middle" }, words, (k > 0 ? "+" : "") + number(k * step) + (k ? " µm" : ""));
  }
  const clip = make("clipPath", { id }, part);
  make("circle", { cx: centre[0], cy: centre[1], r: half + 8 }, clip);
  const field = make("g", { "clip-path": `url(#${id})` }, part);
  part.append(words);
  const shown = panel.curves.filter(entry => !hidden.has(entry.name));
  for (const curve of shown) {
    const angle = values(curve.x), deviation = values(curve.y), n = angle.length;
    const points = Array.from(angle, (entry, k) => place(entry, deviation[k]).map(value => Math.round(10 * value) / 10).join(" ")).filter((point, k, all) => point !== all[k - 1]);
    const turned = n && Math.abs(Math.sin((angle[n - 1] - angle[0]) / 2)) < END_ANGLE_SINE;
    const ends = turned && Math.abs(deviation[n - 1] - deviation[0]) < CLOSED_TURN_GAP * reach;
    make("path", { ...styled(curve), d: n ? `M${points.join("L")}${ends ? "Z" : ""}` : "" }, field);
  }
  for (const mark of panel.marks) {
    const [x, y] = place(mark.x, mark.y), inside = one * (1 - OUTER_RADIUS * RING_GAPS[panel.rings]);
    const to = [centre[0] + inside * Math.cos(mark.x), centre[1] - inside * Math.sin(mark.x)];
    make("circle", { cx: x, cy: y, r: 4, fill: colour(mark.colour) }, part);
    if (!mark.text) continue;
    make("line", { x1: x, y1: y, x2: to[0], y2: to[1], stroke: colour(mark.colour), "stroke-width": 0.9 }, part);
    const side = Math.round(Math.cos(mark.x)), lower = Math.round(Math.sin(mark.x));
    make("text", { x: to[0] - 3 * side, y: to[1] + 4 + 9 * lower, "text-anchor": ["start", "middle", "end"][side + 1], ...HALO }, part, mark.text);
  }
  if (half > 190) panel.note.split("\n").forEach((line, k) => make("text", { x: centre[0], y: centre[1] - 0.3 * one + 14 * k, "text-anchor": "middle", fill: colour("muted"), "font-size": 11 }, part, line));
  if (panel.sense) {
    const arc = [50, 130].map(entry => entry * Math.PI / 180).sort((a, b) => panel.sense * (a - b)), r = 0.16 * one, low = centre[1] + 0.36 * one;
    const [from, to] = arc.map(entry => [centre[0] + r * Math.cos(entry), low - r * Math.sin(entry)]);
    make("path", { d: `M${from.join(" ")}A${r} ${r} 0 0 ${panel.sense > 0 ? 0 : 1} ${to.join(" ")}`, fill: "none", stroke: colour("muted"), "stroke-width": 1.3 }, part);
    const back = panel.sense;
    make("path", { d: `M${to[0]} ${to[1]}l${7 * back} -1l${-2.5 * back} -5.5Z`, fill: colour("muted") }, part);
  }
  return { panel, box, centre, radius, place, reach, shown, part, half };
}

function draw_grid(panel, box, parent, values) {
  const part = make("g", { transform: `translate(${box.x} ${box.y})` }, parent), cells = values(panel.values);
  headed(panel.title, 4, box.width - 4, part);
  const left = grid_left(panel), top = grid_top(panel), columns = panel.columns.length;
  const slanted = SLANTED_LETTER_WIDTH * panel.columns[columns - 1].length; // the last name leans over the edge
  const width = Math.min((box.width - left - 8) / columns, (box.width - left - 8 - slanted) / (columns - 0.5)), height = ROW, numbers = width >= CELL_WITH_NUMBER;
  const [low, high] = panel.span, about_zero = low < 0 && high > 0;
  const every = Math.ceil(CELL_WITH_NAME / width);
  panel.columns.forEach((name, j) => j % every || make("text", { transform: `translate(${left + (j + 0.5) * width} ${top - 6}) rotate(-40)`, fill: colour("ink"), "font-size": 11 }, part, name));
  panel.rows.forEach((name, i) => make("text", { x: left - 8, y: top + (i + 0.5) * height + 4, "text-anchor": "end", fill: colour("ink"), "font-size": 11 }, part, name));
  const bold = new Set(panel.bold || []);
  const paint = value => {
    const share = about_zero ? Math.abs(value) / Math.max(-low, high) : (value - low) / (high - low || 1);
    return { fill: colour(about_zero && value < 0 ? "vermillion" : "blue"), "fill-opacity": (DEPTH * Math.min(1, Math.max(0, share))).toFixed(3) };
  };
  panel.rows.forEach((row, i) => panel.columns.forEach((column, j) => {
    const value = cells[i * columns + j], box = { x: left + j * width, y: top + i * height, width, height };
    make("rect", { ...box, fill: "none", stroke: colour("grid"), "stroke-width": 0.6 }, part);
    if (!Number.isFinite(value)) return;
    const cell = make("rect", { ...box, ...paint(value) }, part);
    make("title", {}, cell, `${row}, ${column}: ${number(value)}`);
    if (numbers) make("text", { x: box.x + width / 2, y: box.y + height / 2 + 4, "text-anchor": "middle", fill: colour("ink"), "font-size": 11, "font-weight": bold.has(i * columns + j) ? 700 : 400 }, part, panel.decimals === null ? three(value) : fixed(value, panel.decimals));
  }));
  if (!numbers) {
    const end = box.width - 8 - 7 * number(high, 3).length, begin = end - SCALE_STEPS * SCALE_STEP - 4;
    make("text", { x: begin - 4, y: 15, "text-anchor": "end", fill: colour("ink"), "font-size": 11 }, part, number(low, 3));
    make("text", { x: end, y: 15, fill: colour("ink"), "font-size": 11 }, part, number(high, 3));
    for (let k = 0; k < SCALE_STEPS; k++)
      make("rect", { x: begin + k * SCALE_STEP, y: 6, width: SCALE_STEP, height: 10, ...paint(low + (high - low) * (k + 0.5) / SCALE_STEPS) }, part);
  }
  if (panel.best) make("rect", { x: left + panel.best[1] * width, y: top + panel.best[0] * height, width, height, fill: "none", stroke: colour("ink"), "stroke-width": 2.2 }, part);
  return { panel, part };
}
const grid_left = panel => Math.min(260, 16 + 6.4 * panel.rows.reduce((most, entry) => Math.max(most, entry.length), 0));
const grid_top = panel => 36 + 4.3 * panel.columns.reduce((most, entry) => Math.max(most, entry.length), 0);

const top_of = panel => TOP + (panel.x.also ? SECOND : 0);

// As many columns as have room; of more than two that are alike half of them, before they stand below one another.
function columns_of(widths, width) {
  if (width >= Math.max(NARROW, COLUMN * widths.length)) return widths;
  const half = widths.length / 2, alike = widths.every(entry => entry === widths[0]);
  return half > 1 && Number.isInteger(half) && alike ? columns_of(widths.slice(half), width) : [1];
}

// Where every panel goes: boxes, and the height of all. tall: of the panels, against their usual height.
function placed(chart, width, tall = 1) {
  const columns = columns_of(chart.widths, width), total = columns.reduce((a, b) => a + b, 0), boxes = [];
  const aside = chart.panels.some(panel => panel.y && panel.y.also) ? LEFT : RIGHT; // panels below one another end alike
  let y = 4;
  for (let k = 0; k < chart.panels.length; k += columns.length) {
    const row = chart.panels.slice(k, k + columns.length);
    const widths = columns.map(entry => (width - GAP * (columns.length - 1)) * entry / total);
    const natural = row.map((panel, j) => panel.kind === "polar" ? Math.min(widths[j], ROUND * Math.min(1, tall + 0.2)) + 24
      : panel.kind === "grid" ? grid_top(panel) + ROW * panel.rows.length + 12
      : panel.y.names.length ? TOP + BOTTOM + 26 * panel.y.names.length : HEIGHT * tall * panel.height + BOTTOM + top_of(panel) - TOP);
    const height = Math.max(...natural);
    let x = 0;
    row.forEach((panel, j) => {
      const own = row.some(entry => entry.kind === "polar") && panel.kind === "xy" ? Math.min(height, 360) : height;
      boxes.push({ x, y, aside, width: widths[j], height: panel.y && panel.y.names.length ? natural[j] : own });
      x += widths[j] + GAP;
    });
    y += height + 10;
  }
  return { boxes, height: y };
}
