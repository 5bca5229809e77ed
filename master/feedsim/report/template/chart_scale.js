// What the drawing of charts (chart_draw.js) computes with: numbers as text, scales and their ticks, curves as paths.
const SPACE = "http://www.w3.org/2000/svg";
const {
  BAND, BLOCK, BOTTOM, CELL_WITH_NAME, CELL_WITH_NUMBER, CLOSED_TURN_GAP, DASHES, DEPTH, FAINT, FILL, GAP, HEIGHT, LEADER, LEFT, LETTER, LINE_PITCH, MAX_DIGITS, MIN_TICKS,
  MIN_RELATIVE_SPAN, END_ANGLE_SINE, OUTER_RADIUS, PHASES, RIGHT, RING_GAPS, CURVE_MARGIN, ROUND, ROW, SECOND, SCALE_STEP, SCALE_STEPS, SLANTED_LETTER_WIDTH, TICK_HEIGHT, TICK_WIDTH, TOP, UNITS_WITH_PREFIX,
} = LAYOUT; // feedsim.report.chart.model
const NARROW = 640, COLUMN = 250;
const FONT = 'system-ui, "Segoe UI", Arial, sans-serif';

function make(name, attributes = {}, parent = null, text = null) {
  const result = document.createElementNS(SPACE, name);
  for (const key in attributes) result.setAttribute(key, attributes[key]);
  if (text !== null) result.textContent = text;
  if (parent) parent.append(result);
  return result;
}

const colour = name => `var(--${name})`;
const number = (value, digits = 6) => Number.isFinite(value) ? written(Number(value.toPrecision(digits))) : "–";

function written(value) {
  const size = Math.abs(value), [mantissa, power] = value.toExponential().replace("+", "").split("e");
  const text = size && (size < 1e-4 || size >= 1e7) ? `${mantissa}×10${[...power].map(entry => entry === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[entry]).join("")}` : String(value);
  return text.replaceAll("-", "−");
}
const fixed = (value, decimals) => value.toFixed(decimals).replace(/^-(?=0(\.0*)?$)/, "").replace("-", "−");

// Three digits that count, alike in all cells.
const three = value => Math.abs(value) >= 100 || (value && Math.abs(value) < 1e-4) ? number(value, 3) : value.toPrecision(3).replace("-", "−");

const unit_of = axis => axis.unit ? ` ${axis.unit}` : "";
// Words over curves.
const HALO = { "fill": "var(--ink)", "font-size": 11, "paint-order": "stroke", stroke: "var(--ground)", "stroke-width": 3, "stroke-linejoin": "round" };
const label_of = axis => axis.unit ? `${axis.label} [${axis.unit}]` : axis.label;

// A scale from values to pixels and back; within: linear to this distance from zero, beyond logarithmic both ways.
function scale(low, high, first, last, { log, symlog: within }) {
  const by = within ? value => Math.sign(value) * Math.log10(1 + Math.abs(value) / within) : log ? Math.log10 : value => value;
  const back = within ? seen => Math.sign(seen) * within * (10 ** Math.abs(seen) - 1) : log ? seen => 10 ** seen : seen => seen;
  const from = by(low), per = (last - first) / (by(high) - from || 1);
  const to = value => first + (by(value) - from) * per;
  to.back = pixel => back(from + (pixel - first) / per);
  return to;
}

function step_of(rough) {
  const decade = 10 ** Math.floor(Math.log10(rough));
  return decade * [1, 2, 5, 10].find(entry => entry * decade >= rough * 0.999);
}

// Where an axis is marked, and with what. Where a text would have a power of ten, the texts are in the first unit with a
// prefix in which none has one, from that on in which the largest value is 1 or more.
function ticks(axis, low, high, most) {
  const found = ticks_in_unit(axis, low, high, most), has_powers = all => all.some(entry => entry.text && entry.text.includes("×"));
  if (found.common || axis.names.length || !has_powers(found)) return found;
  const known = UNITS_WITH_PREFIX[axis.unit] || [[1, axis.unit]];
  for (const [factor, unit] of known.slice(known.indexOf(with_prefix(known, Math.max(Math.abs(low), Math.abs(high)))))) {
    const there = ticks_in_unit({ ...axis, unit, symlog: (axis.symlog || 0) * factor }, low * factor, high * factor, most);
    if (!has_powers(there)) return Object.assign(there.map(entry => ({ ...entry, at: entry.at / factor })), { unit });
  }
  return found;
}

// Factor and unit in which a size is 1 or more, else the finest that is known.
const with_prefix = (known, size) => known.find(([factor]) => size * factor >= 1) || known.at(-1);

function ticks_in_unit(axis, low, high, most) {
  if (axis.names.length) {
    const every = Math.ceil(axis.names.length / Math.max(1, most));
    return axis.names.map((name, k) => ({ at: k, text: name })).filter((entry, k) => k % every === 0 && k >= low && k <= high);
  }
  if (axis.symlog) {
    const decades = [];
    for (let at = 10 ** Math.ceil(Math.log10(axis.symlog * 2) - 1e-9); at <= Math.max(-low, high); at *= 10) decades.push(at);
    const seen = [...decades.map(at => -at).reverse(), 0, ...decades].filter(at => at >= low && at <= high);
    if (seen.length > 1) return seen.map(at => ({ at, text: number(at) }));
  }
  if (axis.log && high / low > 8) {
    const result = [], decades = Math.log10(high / low), few = decades < 2.2, every = Math.max(1, Math.round(decades / most));
    for (let k = Math.floor(Math.log10(low)); k <= Math.log10(high); k++)
      for (const part of [1, 2, 3, 4, 5, 6, 7, 8, 9]) {
        const at = part * 10 ** k;
        if (at >= low * 0.9999 && at <= high * 1.0001)
          result.push({ at, text: (part === 1 && k % every === 0) || (few && (part === 2 || part === 5)) ? number(at) : "" });
      }
    return result;
  }
  const turns = axis.unit === "°" && high - low > 60;
  let step = turns ? PHASES.find(entry => (high - low) / entry <= most) || 3600 : step_of((high - low) / most);
  const marked = entry => Math.floor(high / entry + 1e-9) - Math.ceil(low / entry - 1e-9) + 1;
  for (let less; marked(step) < MIN_TICKS; step = less) { // one or two ticks are no scale
    less = finer(step, turns);
    if (!less || (marked(step) > 1 && marked(less) > most + 2)) break;
  }
  return marks_of(axis, low, high, step);
}

// Ticks a step apart, with as many digits as the step asks for. Where these are many, what they all have in common
// stands at the axis, and the ticks say what is added to it.
function marks_of(axis, low, high, step) {
  const result = [], digits = at => Math.max(6, Math.floor(Math.log10(Math.abs(at) || step)) - Math.floor(Math.log10(step) + 1e-9) + 1);
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) result.push({ at: k * step });
  if (Math.max(...result.map(entry => digits(entry.at))) <= MAX_DIGITS) for (const entry of result) entry.text = number(entry.at, digits(entry.at));
  else {
    const whole = 10 ** Math.ceil(Math.log10(high - low) - 1e-9), common = Math.floor(low / whole + 1e-9) * whole, part = high - common;
    const [factor, unit] = with_prefix(UNITS_WITH_PREFIX[axis.unit] || [[1, axis.unit]], part);
    for (const entry of result) entry.text = number(Math.round((entry.at - common) / step) * step * factor, 4);
    result.common = `${number(common, Math.floor(Math.log10(Math.abs(common) || 1)) - Math.floor(Math.log10(whole) + 1e-9) + 1)}${unit_of(axis)}`;
    result.unit = unit;
  }
  return result;
}

// Ticks along the abscissa whose words do not touch: fewer of them, in the end every second one without its word.
// end: where the last word has to stop.
function apart(found_of, across, most, end = Infinity) {
  const touching = all => {
    const words = all.filter(entry => entry.text), middle = entry => Math.min(across(entry.at), end - 3.6 * entry.text.length);
    return words.some((entry, k) => k && Math.abs(middle(entry) - middle(words[k - 1])) < 3.5 * (entry.text.length + words[k - 1].text.length) + 6);
  };
  let result = found_of(most);
  while (most > 2 && touching(result)) result = found_of(--most);
  for (let k = 0; k < 3 && touching(result); k++) result.filter(entry => entry.text).forEach((entry, i) => { if (i % 2) entry.text = ""; });
  return result;
}

// What stands along an axis: quantity and unit, or what its ticks are added to.
function title_of(axis, result) {
  return result.common ? `${axis.label} − ${result.common}${result.unit ? ` [${result.unit}]` : ""}` : label_of(result.unit ? { ...axis, unit: result.unit } : axis);
}

// A range that a zoom asks for, no narrower than its numbers have digits for.
function wide_enough([low, high], axis) {
  const least = axis.log || axis.names.length ? 0 : MIN_RELATIVE_SPAN * Math.max(Math.abs(low), Math.abs(high));
  return high - low >= least ? [low, high] : [(low + high - least) / 2, (low + high + least) / 2];
}

// First row whose abscissa is not below; x ascending.
function row_at(x, value) {
  let low = 0, high = x.length;
  while (low < high) { const middle = (low + high) >> 1; if (x[middle] < value) low = middle + 1; else high = middle; }
  return low;
}

function nearest(x, value) {
  const k = row_at(x, value);
  return k > 0 && (k === x.length || value - x[k - 1] <= x[k] - value) ? k - 1 : k;
}

// A curve as a path: of each column of pixels its extremes, where several rows share a column.
function path_of(x, y, across, up, range, columns) {
  const parts = [];
  let pen = "M", last_a = NaN, last_b = NaN;
  const point = k => {
    const a = Math.round(10 * across(x[k])) / 10, b = Math.round(10 * up(y[k])) / 10;
    if (!Number.isFinite(a) || !Number.isFinite(b)) { pen = "M"; return; }
    if (pen === "L" && a === last_a && b === last_b) return; // the same tenth of a pixel
    parts.push(pen, a, " ", b);
    [pen, last_a, last_b] = ["L", a, b];
  };
  if (!range) { for (let k = 0; k < x.length; k++) point(k); return parts.join(""); }
  const begin = Math.max(0, row_at(x, range[0]) - 1), end = Math.min(x.length, row_at(x, range[1]) + 2);
  if (end - begin < 4 * columns) { for (let k = begin; k < end; k++) point(k); return parts.join(""); }
  for (let k = begin; k < end;) {
    const column = Math.floor(across(x[k]));
    let least = k, most = k, last = k;
    for (; last < end && Math.floor(across(x[last])) === column; last++) {
      if (y[last] < y[least]) least = last;
      if (y[last] > y[most]) most = last;
    }
    for (const entry of [...new Set([k, Math.min(least, most), Math.max(least, most), last - 1])]) point(entry);
    k = last;
  }
  return parts.join("");
}

function finer(step, turns) {
  if (turns) return PHASES.filter(entry => entry < step).pop();
  const decade = 10 ** Math.floor(Math.log10(step) + 1e-9);
  return decade * { 1: 0.5, 2: 1, 5: 2 }[Math.round(step / decade)];
}

const styled = curve => ({
  fill: "none", stroke: colour(curve.colour), "stroke-width": curve.width, "stroke-linejoin": "round",
  ...(curve.dash ? { "stroke-dasharray": DASHES[curve.dash] } : {}), ...(curve.grey ? { class: `grey-${curve.grey}` } : {}), ...(curve.faint ? { "stroke-opacity": FAINT } : {}),
});

// Least and largest ordinate of the curves that are seen, with room about them.
function range_of(panel, curves, values, span) {
  let low = Infinity, high = -Infinity;
  const seen = value => {
    if (Number.isFinite(value) && (!panel.y.log || value > 0)) { low = Math.min(low, value); high = Math.max(high, value); }
  };
  for (const curve of curves) {
    const x = values(curve.x), y = values(curve.y);
    if (curve.filled) seen(0);
    for (let k = 0; k < x.length; k++) if (x[k] >= span[0] && x[k] <= span[1]) seen(y[k]);
  }
  for (const mark of panel.marks) if (mark.x >= span[0] && mark.x <= span[1]) seen(mark.y);
  if (low > high) return panel.y.span || (panel.y.log ? [0.1, 10] : [-1, 1]);
  if (panel.y.log) return [low / 1.3, high * 1.3];
  if (panel.y.symlog) { // room in the measure of the axis, on either side of zero
    const more = (value, sign) => value + sign * (3 * CURVE_MARGIN * Math.abs(value) + (high > low ? 0 : panel.y.symlog));
    return [more(low, -1), more(high, 1)];
  }
  if (high > low) [low, high] = wide_enough([low, high], panel.y);
  const room = CURVE_MARGIN * (high - low) || 0.05 * Math.abs(high) || 1;
  return [low - (low === 0 && curves.some(entry => entry.filled) ? 0 : room), high + room];
}

function whole_span(panel, values) {
  if (panel.x.span) return panel.x.span;
  let low = Infinity, high = -Infinity;
  for (const curve of panel.curves) for (const entry of values(curve.x))
    if (Number.isFinite(entry) && (!panel.x.log || entry > 0)) { low = Math.min(low, entry); high = Math.max(high, entry); }
  if (low > high) return [0, 1];
  return high > low ? [low, high] : [low - 0.5, low + 0.5];
}

