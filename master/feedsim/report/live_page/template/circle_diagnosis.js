// Why a circle is not round: feedsim.analysis.circle (diagnosis.py, vibration.py) and circle_figures.py once more.
const PEAK = { OVER: 1, LEAST: 3, SEEN: 5.5, ELSEWHERE: 1.5, SELDOM: 1e-3, BLUR: 0.015, FLOOR: 1e-9 }, FORM = [3, 4, 5], LEAST_SAMPLES = 180, ANGLES = 720;
const SWING = { FLOOR: 10e-9, LINES: 7, AROUND: 101, STANDS_OUT: 10, FIRST_ORDER: 13, FINE: 0.05, AHEAD: 5 * RADIANS, BEHIND: 60 * RADIANS };

// Turns of one circle taken apart; null where they have too few samples. known: {pitch, gain, drag, students}; gain: axis -> [re, im];
// drag: axis -> the same at the odd multiples of the circle's frequency.
function diagnosed(trace, turns, known) {
  const turn = turns[0], paths = [];
  for (const entry of turns) {
    const { time, angle, deviation } = contour(trace, entry);
    if (angle.length < LEAST_SAMPLES) return null;
    paths.push({ angle, deviation, sense: entry.sense, phase: time.map(t => (t - time[0]) * (2 * Math.PI / (entry.end - entry.begin))) });
  }
  return diagnose({ axes: turn.axes, radius: turn.radius, speed: 2 * Math.PI * turn.radius / (turn.end - turn.begin), pitch: known.pitch, gain: known.gain || {}, drag: known.drag || {}, following: known.following || {} }, paths, known.students);
}

function diagnose(circle, whole, students) {
  const paths = whole.map(thinned_path), result = fit_circle(circle, paths, students), e = concatenated(paths.map(path => path.deviation)), parts = curves_of(result, paths, circle);
  const rest = Float64Array.from(e);
  for (const part of Object.values(parts)) part.forEach((entry, k) => { rest[k] -= entry; });
  parts["rest "] = rest;
  const G = range_of(e), high = e.indexOf(largest(e)), low = e.indexOf(least(e)), peaks = paths.flatMap((path, k) => peaks_of(circle, result, k, path.sense));
  const terms = Object.entries(parts).map(([name, part]) => {
    const [key, axis] = name.split(" "), [value, half, unit] = value_of(circle, result, peaks, key, axis), size = range_of(part);
    const term = { key, axis, value: key === "rest" ? size : value, half, unit, size, share: G > 0 ? (part[high] - part[low]) / G : 0, gain: G - range_of(e.map((entry, k) => entry - part[k])) };
    const seen = key === "radius" ? Math.abs(term.value) : size;
    return { ...term, certain: seen > PEAK.FLOOR && (Number.isNaN(half) || Math.abs(term.value) > half) };
  });
  const last = term => Number(!term.certain || term.key === "rest"), order = term => -Math.round(term.gain / PEAK.FLOOR);
  terms.sort((a, b) => last(a) - last(b) || order(a) - order(b) || b.size - a.size);
  return { circle, senses: paths.map(path => path.sense), G, terms, peaks, vibrations: vibrations_of(circle, result, whole), lag: lag_of(circle), unlike: unlike_of(circle), form: form_of(result), noise: result.noise, left_out: result.left_out };
}

function thinned_path(path) {
  const step = Math.ceil(path.angle.length / MODEL.MOST), every = values => step > 1 ? values.filter((_, k) => k % step === 0) : values;
  return { ...path, angle: every(path.angle), deviation: every(path.deviation), phase: every(path.phase) };
}

function lag_of({ axes, radius, gain }) {
  if (axes.some(axis => !(axis in gain))) return null;
  return radius * (Math.hypot(...[0, 1].map(i => gain[axes[0]][i] + gain[axes[1]][i])) / 2 - 1);
}

function unlike_of({ axes, gain }) {
  if (axes.some(axis => !(axis in gain))) return null;
  return Math.hypot(...gain[axes[0]]) - Math.hypot(...gain[axes[1]]);
}

// "term axis" -> radial deviation that it makes, of all paths.
function curves_of(result, paths, circle) {
  const curves = {};
  paths.forEach((_, p) => {
    const made = {}, sum = (a, b) => a.map((entry, k) => entry + b[k]), named = {};
    result.names.forEach((name, i) => { made[name] = result.columns[p][name].map(entry => result.values[i] * entry); });
    named["offset "] = sum(made.offset_0, made.offset_1);
    named["radius "] = made.radius;
    named["scale "] = made.scale;
    named[made.servo ? "squareness " : "squareness_or_servo "] = made.squareness;
    if (made.servo) named["servo "] = made.servo;
    circle.axes.forEach((axis, i) => {
      named[`lost_motion ${axis}`] = made[`lost_${i}`];
      if (made[`pitch_${i}_cos`] && !result.left_out.includes(axis)) named[`pitch ${axis}`] = sum(made[`pitch_${i}_cos`], made[`pitch_${i}_sin`]);
      named[`peaks ${axis}`] = result.residual[p].map((entry, k) => result.reversal[p][k] >= 0 && result.reversal[p][k] % 2 === i ? entry : 0);
    });
    for (const name in named) (curves[name] ||= []).push(named[name]);
  });
  return Object.fromEntries(Object.entries(curves).map(([name, entry]) => [name, concatenated(entry)]));
}

function value_of(circle, result, peaks, key, axis) {
  const i = axis ? circle.axes.indexOf(axis) : 0;
  if (key === "peaks") { const own = largest_peak(peaks, axis); return [own.height, own.half, "m"]; }
  if (key === "rest") return [NaN, NaN, "m"];
  const [names, factor, unit] = {
    offset: [["offset_0", "offset_1"], 1, "m"], radius: [["radius"], 1, "m"], scale: [["scale"], 2 / circle.radius, "1"], squareness: [["squareness"], 2 / circle.radius, "rad"],
    squareness_or_servo: [["squareness"], 1, "m"], servo: [["servo"], 2 / circle.speed, "s"], lost_motion: [[`lost_${i}`], 1, "m"], pitch: [[`pitch_${i}_cos`, `pitch_${i}_sin`], 1, "m"],
  }[key];
  return [factor * (names.length === 2 ? Math.hypot(...names.map(result.of)) : result.of(names[0])), factor * half_of(result, ...names), unit];
}
const largest_peak = (peaks, axis) => peaks.filter(peak => peak.axis === axis).reduce((best, peak) => Math.abs(peak.height) > Math.abs(best.height) ? peak : best);

// --- what stands out behind a reversal --------------------------------------------------------------------------------

function peaks_of(circle, result, p, sense) {
  const rate = circle.speed / circle.radius, compare = calm_of(result, p, sense), per_sample = 2 * Math.PI / result.angle[p].length, wide = Math.max(1, half_even(PEAK.OVER * RADIANS / per_sample)), counts = [wide];
  while (Math.floor(counts[counts.length - 1] / 2) >= PEAK.LEAST) counts.push(Math.floor(counts[counts.length - 1] / 2));
  const levels = counts.map(count => [count, compare.level(count)]), ellipse = Math.hypot(result.of("scale"), result.of("squareness") + sense * result.of("servo")) / circle.radius;
  return [0, 1, 2, 3].map(which => {
    const axis = circle.axes[which % 2], nothing = { name: `${axis}${which < 2 ? "+" : "-"}`, axis, sense, height: 0, half: NaN, angle: which * Math.PI / 2, width: NaN, decay: NaN };
    const own = rows_where(result.reversal[p], (entry, k) => entry === which && Math.abs(result.since[p][k]) > 1.5 * per_sample + ellipse).sort((a, b) => result.since[p][a] - result.since[p][b]);
    if (own.length < 5 * wide) return nothing;
    const since = Float64Array.from(own, k => result.since[p][k]), off = Float64Array.from(own, k => result.residual[p][k]), [clear, first] = clearest(off, levels);
    if (clear < 1) return { ...nothing, half: levels[0][1] };
    const { curve, at, count } = sharpened(off, first, result.noise), height = curve[at], blur = count > 1 ? averaged(off, 2 * count)[at] - height : 0, relative = curve.map(entry => entry / height);
    return { ...nothing, height, half: Math.hypot(result.student * compare.spread(count), blur), angle: result.angle[p][own[at]], width: (falls(since, relative, at, 0.5, 1) - falls(since, relative, at, 0.5, -1)) / rate,
      decay: (falls(since, relative, at, 1 / Math.E, 1) - since[at]) / rate };
  });
}
const half_even = value => { const floor = Math.floor(value); return value - floor === 0.5 ? floor + floor % 2 : Math.round(value); };

function clearest(off, levels) {
  return levels.map(([count, level]) => { const [curve, at] = top_of(off, count); return [Math.abs(curve[at]) / level, count]; }).reduce((best, entry) => entry[0] > best[0] || (entry[0] === best[0] && entry[1] > best[1]) ? entry : best);
}

function sharpened(off, count, noise) {
  for (;;) {
    const [curve, at] = top_of(off, count), low = k => Math.abs(curve[k]) / Math.abs(curve[at]) < 0.5, sides = [];
    for (let k = at; k < curve.length; k++) if (low(k)) { sides.push(k - at); break; }
    for (let k = at; k >= 0; k--) if (low(k)) { sides.push(at - k); break; }
    const steeper = sides.length ? Math.min(...sides) : 2 * count, enough = Math.max(1, Math.min(count, Math.ceil((noise / (PEAK.BLUR * Math.abs(curve[at]))) ** 2), Math.floor(steeper / 2)));
    if (enough === count) return { curve, at, count };
    count = enough;
  }
}

// Means over `count` samples and the number of the largest; not of one at an end, which fewer samples make.
function top_of(off, count) {
  const curve = averaged(off, count), end = Math.floor(count / 2);
  let at = end;
  for (let k = end; k < curve.length - end; k++) if (Math.abs(curve[k]) > Math.abs(curve[at])) at = k;
  return [curve, at];
}

// Means of neighbouring samples where no axis reverses: what those behind a reversal are compared with.
function calm_of(result, p, sense) {
  const order = Array.from(result.angle[p].keys()).sort((a, b) => sense * (result.angle[p][a] - result.angle[p][b])), off = Float64Array.from(order, k => result.residual[p][k]), rest = rest_error(result);
  const free = Float64Array.from(order, k => result.reversal[p][k] < 0 ? 1 : 0), means = count => {
    const before = Math.floor(Math.min(count, off.length) / 2), whole = rows_where(free, (_, i) => {
      for (let k = i - before; k < i - before + count; k++) if (!free[k]) return false;
      return true;
    }), around = averaged(off, count);
    return Float64Array.from(whole.length ? whole : rows_where(free, entry => entry > 0), k => around[k]);
  };
  return {
    spread: count => Math.hypot(Math.max(result.noise / Math.sqrt(count), Math.sqrt(mean(means(count).map(entry => entry ** 2)))), rest),
    level: count => Math.max(PEAK.SEEN * Math.hypot(result.noise / Math.sqrt(count), rest), PEAK.ELSEWHERE * quantile(means(count).map(Math.abs), 1 - PEAK.SELDOM), PEAK.FLOOR),
  };
}

// Angle at which a peak falls to `level` of its height, on one side of its top; NaN: never.
function falls(since, relative, at, level, way) {
  for (let k = at; k >= 0 && k < since.length; k += way)
    if (relative[k] < level) { const before = k - way, share = (relative[before] - level) / (relative[before] - relative[k]); return since[before] + share * (since[k] - since[before]); }
  return NaN;
}

function form_of(result) {
  const free = result.reversal.map(which => rows_where(which, entry => entry < 0)), angle = concatenated(result.angle.map((entry, p) => Float64Array.from(free[p], k => entry[k]))), off = concatenated(result.residual.map((entry, p) => Float64Array.from(free[p], k => entry[k])));
  const values = least_squares(FORM.flatMap(n => [angle.map(entry => Math.cos(n * entry)), angle.map(entry => Math.sin(n * entry))]), off);
  return FORM.map((n, i) => [n, Math.hypot(values[2 * i], values[2 * i + 1])]);
}

// --- what swings between the reversals --------------------------------------------------------------------------------

function vibrations_of(circle, result, paths) {
  const best = {};
  for (const path of paths) for (const [axis, angle, off, free] of swinging_signals(circle, path)) {
    const entry = strongest(circle, axis, angle, off, free, result.student);
    if (entry && !(axis in best && entry.amplitude <= best[axis].amplitude)) best[axis] = entry;
  }
  return Object.values(best).sort((a, b) => b.amplitude - a.amplitude);
}

function swinging_signals(circle, path) {
  const rows = rows_where(path.phase, entry => entry < 2 * Math.PI), phase = Float64Array.from(rows, k => path.phase[k]), first = [phase.map(Math.cos), phase.map(Math.sin)];
  return circle.axes.map((axis, i) => {
    const position = Float64Array.from(rows, k => (circle.radius + path.deviation[k]) * (i ? Math.sin : Math.cos)(path.angle[k])), middle = mean(position), [a, b] = least_squares(first, position.map(entry => entry - middle));
    const free = phase.map(entry => modulo(entry - Math.atan2(b, a) + SWING.AHEAD, Math.PI) > SWING.AHEAD + SWING.BEHIND ? 1 : 0), columns = [phase.map(() => 1), ...first, phase.map((_, k) => sign_of(b * first[0][k] - a * first[1][k]))];
    if (enough_pitches(circle, axis)) { const along = position.map(entry => 2 * Math.PI / circle.pitch[axis] * entry); columns.push(along.map(Math.cos), along.map(Math.sin)); }
    const inside = rows_where(free, entry => entry > 0), taken = column => Float64Array.from(inside, k => column[k]), made = combined(columns, least_squares(columns.map(taken), taken(position)), phase.length);
    return [axis, phase, position.map((entry, k) => entry - made[k]), free];
  });
}

function strongest(circle, axis, angle, off, free, student) {
  const n = angle.length, even = Float64Array.from({ length: n }, (_, k) => k * (2 * Math.PI / n)), still = interpolated(even, angle, off.map((entry, k) => free[k] ? entry : 0), 2 * Math.PI), usable = power_spectrum(still).slice(SWING.FIRST_ORDER), count = usable.length;
  if (count < 2 * SWING.AROUND) return null;
  const around = averaged(usable, SWING.LINES), aside = 2 * SWING.LINES, floor = spectrum_floor(usable);
  let at = -1;
  for (let k = 0; k < count; k++) {
    const sides = Math.max(around[Math.max(k - aside, 0)], around[Math.min(k + aside, count - 1)], k < aside ? around[aside + k] : 0);
    if (around[k] > SWING.STANDS_OUT * Math.max(floor[k], 1e-300) && around[k] > SWING.STANDS_OUT * sides && (at < 0 || around[k] > around[at])) at = k;
  }
  if (at < 0) return null;
  const half = Math.floor(SWING.LINES / 2), from = Math.max(at - half, 0), to = Math.min(at + half, count - 1), steps = Math.ceil((to + SWING.FINE - from) / SWING.FINE), rows = rows_where(free, entry => entry > 0);
  let order = 0, most = -1;
  for (let j = 0; j < steps; j++) {
    const tried = from + j * SWING.FINE + SWING.FIRST_ORDER;
    let re = 0, im = 0;
    for (const k of rows) { re += Math.cos(tried * angle[k]) * off[k]; im += Math.sin(tried * angle[k]) * off[k]; }
    if (Math.hypot(re, im) > most) { most = Math.hypot(re, im); order = tried; }
  }
  const inside = Float64Array.from(rows, k => angle[k]), own = Float64Array.from(rows, k => off[k]), columns = [];
  for (let n = -half; n <= half; n++) columns.push(inside.map(entry => Math.cos((order + n) * entry)), inside.map(entry => Math.sin((order + n) * entry)));
  const swings = combined(columns, least_squares(columns, own), own.length), left = own.map((entry, k) => entry - swings[k]), middle = mean(left), amplitude = Math.sqrt(2 * mean(swings.map(entry => entry ** 2)));
  const noise = Math.sqrt(mean(left.map(entry => (entry - middle) ** 2)));
  return amplitude > SWING.FLOOR ? { axis, frequency: order * circle.speed / (2 * Math.PI * circle.radius), amplitude, half: student * noise * Math.sqrt(2 / Math.max(rows.length, 1)) } : null;
}

// Mean power of the lines around each, if they are noise: their median is ln 2 of it.
function spectrum_floor(power) {
  const half = Math.floor(SWING.AROUND / 2), edges = [];
  for (let k = 0; k < power.length; k += half) edges.push(k);
  return interpolated(power.keys(), edges, edges.map(edge => median(power.slice(Math.max(edge - half, 0), edge + half + 1)))).map(entry => entry / Math.LN2);
}

// --- figures ----------------------------------------------------------------------------------------------------------

const CAUSES = ["peaks", "servo", "squareness", "squareness_or_servo", "scale", "lost_motion", "pitch", "radius", "offset", "rest"];
const CAUSE_UNITS = { s: [1e3, "ms"], m: [1e6, "um"], 1: [1e6, "um/m"], rad: [1e6, "um/m"] }, CAUSE_NAMES = { servo: "servo_mismatch", scale: "scale_mismatch", peaks: "peak", radius: "radius_change" };

function cause_figures(diagnosis) {
  const result = {}, um = value => [value * 1e6, "um"], terms = [...diagnosis.terms].sort((a, b) => CAUSES.indexOf(a.key) - CAUSES.indexOf(b.key) || (a.axis < b.axis ? -1 : a.axis > b.axis ? 1 : 0));
  for (const term of terms) { const [factor, unit] = CAUSE_UNITS[term.unit]; result[`${CAUSE_NAMES[term.key] || term.key}${term.axis ? "_" : ""}${term.axis}`] = [factor * term.value, unit]; }
  if (diagnosis.lag !== null) result.radius_lag = um(diagnosis.lag);
  const [first] = diagnosis.vibrations;
  result.vibration = um(first ? first.amplitude : 0);
  result.vibration_frequency = [first ? first.frequency : NaN, "Hz"];
  for (const entry of diagnosis.vibrations) { result[`vibration_${entry.axis}`] = um(entry.amplitude); result[`vibration_frequency_${entry.axis}`] = [entry.frequency, "Hz"]; }
  return result;
}

// ISO 230-4's figures of two turns in opposite senses, about the centre of the circle fitted to both.
function bidirectional(trace, turn, back) {
  const turns = [turn, back].map(entry => contour(trace, entry)), [p, q] = fitted_centre({ angle: concatenated(turns.map(entry => entry.angle)), deviation: concatenated(turns.map(entry => entry.deviation)) }, turn.radius);
  const around = turns.map(({ angle, deviation }) => {
    const x = angle.map((entry, k) => (turn.radius + deviation[k]) * Math.cos(entry) - p), y = angle.map((entry, k) => (turn.radius + deviation[k]) * Math.sin(entry) - q);
    return { angle: x.map((entry, k) => Math.atan2(y[k], entry)), deviation: x.map((entry, k) => length_of(entry, y[k]) - turn.radius) };
  });
  const even = Float64Array.from({ length: ANGLES }, (_, k) => k * (2 * Math.PI / ANGLES) - Math.PI), [there, again] = around.map(({ angle, deviation }) => {
    const order = Array.from(angle.keys()).sort((a, b) => angle[a] - angle[b]);
    return interpolated(even, order.map(k => angle[k]), order.map(k => deviation[k]), 2 * Math.PI);
  }), um = value => [value * 1e6, "um"];
  return { G_b: um(range_of(concatenated(around.map(entry => entry.deviation)))), D: um((mean(there) + mean(again)) / 2), H: um(largest(there.map((entry, k) => Math.abs(entry - again[k])))) };
}
