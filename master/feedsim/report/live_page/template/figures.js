// Figures of stops and circles: feedsim.analysis (positioning.py, circularity.py) once more. A test holds both to the same digits.
const RINGING = [0.030, 0.400], REST = 1.0, LEAST_REST = 0.050, SHORTEST_PLATEAU = 0.125, PLATEAU = [0.4, 0.9], RUN_IN = 0.2;
const QUARTER = Math.PI / 2;

// Rows [first, behind the last] with begin <= time <= end.
function rows_within(time, begin, end) {
  const slack = 1e-6 * (time[1] - time[0]);
  let first = 0, last = time.length;
  while (first < time.length && time[first] < begin - slack) first++;
  while (last > first && time[last - 1] > end + slack) last--;
  return [first, last];
}

const least = values => values.reduce((a, b) => Math.min(a, b), Infinity);
const largest = values => values.reduce((a, b) => Math.max(a, b), -Infinity);
const mean = values => values.reduce((a, b) => a + b, 0) / values.length;

function median(values) {
  const sorted = Float64Array.from(values).sort(), n = sorted.length;
  return n % 2 ? sorted[(n - 1) / 2] : (sorted[n / 2 - 1] + sorted[n / 2]) / 2;
}

// --- stops ------------------------------------------------------------------------------------------------------------

// The stop that an entry of `evaluate` asks for: {axis, band, start, end, until, origin, target, steady}, or why there is none.
function approach_of(item, segments, duration) {
  const { axis } = item, chosen = item.motion === null ? segments : segments.slice(item.motion, item.motion + 1);
  const moved = chosen.filter(entry => entry.origin[axis] !== entry.target[axis]), segment = moved[moved.length - 1];
  if (!segment) return { problem: `positioning of axis ${axis}: no motion takes it to another position` };
  const next = segments.slice(segment.index + 1).find(entry => entry.axes.includes(axis));
  return {
    kind: "positioning", prefix: axis, axis, band: item.band, start: segment.start, end: segment.end, until: next ? next.start : duration,
    origin: segment.origin[axis], target: segment.target[axis], steady: segment.steady || null, sense: Math.sign(segment.target[axis] - segment.origin[axis]),
  };
}

function rest_seen(time, stop, since) {
  const interval = time.length > 1 ? time[1] - time[0] : 0;
  return Math.min(stop.until, time[time.length - 1] + interval) - since >= LEAST_REST;
}

function stop_rows(time, stop) {
  return rows_within(time, stop.start, Math.max(stop.end, Math.min(stop.until, time[time.length - 1])));
}

// Time and distance beyond the target from the motion's start to its last instant.
function beyond(trace, stop, name) {
  const [first, last] = stop_rows(trace.time, stop);
  return { time: trace.time.slice(first, last), y: trace[name].slice(first, last).map(x => stop.sense * (x - stop.target)) };
}

function last_outside(time, deviation, band) {
  let k = time.length - 1;
  while (k >= 0 && !(Math.abs(deviation[k]) > band)) k--;
  if (k < 0) return -Infinity;
  if (k === time.length - 1) return NaN;
  const edge = deviation[k] < 0 ? -band : band, share = (deviation[k] - edge) / (deviation[k] - deviation[k + 1]);
  return time[k] + share * (time[k + 1] - time[k]);
}

function frequency_of(time, speed) {
  let first = NaN, last = NaN, count = 0;
  for (let k = 0; k + 1 < time.length; k++)
    if (speed[k] < 0 && speed[k + 1] >= 0) {
      last = time[k] + speed[k] / (speed[k] - speed[k + 1]) * (time[k + 1] - time[k]);
      if (!count++) first = last;
    }
  return count > 1 ? (count - 1) / (last - first) : NaN;
}

function ringing(time, speed, stop) {
  const inside = [], values = [];
  time.forEach((t, k) => {
    if (t >= stop.end + RINGING[0] && t <= Math.min(stop.end + RINGING[1], stop.until)) { inside.push(t); values.push(speed[k]); }
  });
  return rest_seen(time, stop, stop.end) ? frequency_of(inside, values) : NaN;
}

// numpy.gradient over even instants of recorded times
function gradient(y, x) {
  const n = y.length, result = new Float64Array(n);
  result[0] = (y[1] - y[0]) / (x[1] - x[0]);
  result[n - 1] = (y[n - 1] - y[n - 2]) / (x[n - 1] - x[n - 2]);
  for (let k = 1; k < n - 1; k++) {
    const before = x[k] - x[k - 1], behind = x[k + 1] - x[k];
    result[k] = (before ** 2 * y[k + 1] + (behind ** 2 - before ** 2) * y[k] - behind ** 2 * y[k - 1]) / (before * behind * (before + behind));
  }
  return result;
}

function stop_figures(trace, stop, name) {
  const { time, y } = beyond(trace, stop, name), peak = largest(y), at_end = y[y.length - 1];
  const arrived = y.indexOf(peak) < y.length - 1 || Math.abs(at_end) <= stop.band;
  let from = 0;
  while (from < time.length && time[from] < stop.end) from++;
  const outside = last_outside(time.slice(from), y.slice(from), stop.band);
  const settled = Number.isNaN(outside) ? NaN : Math.max(outside, stop.end);
  return {
    overshoot: [rest_seen(time, stop, stop.end) && arrived ? Math.max(peak, 0) * 1e6 : NaN, "um"],
    settling_time: [rest_seen(time, stop, settled) ? (settled - stop.end) * 1e3 : NaN, "ms"],
    ringing_frequency: [ringing(time, gradient(y, time), stop), "Hz"],
  };
}

function positioning(trace, stop) {
  const { axis } = stop, { time } = trace, n_a = trace[`${axis}.n_a`], M_a = trace[`${axis}.M_a`], M_fr = trace[`${axis}.M_fr`];
  const result = { duration: [stop.end - stop.start, "s"], ...stop_figures(trace, stop, `${axis}.x_a`) };
  result.ringing_frequency = [ringing(time, n_a.map(entry => stop.sense * entry), stop), "Hz"];
  result.peak_torque = [largest(M_a.slice(...stop_rows(time, stop)).map(Math.abs)), "N.m"];
  if (stop.steady) {
    const [begin, end] = PLATEAU.map(share => stop.steady[0] + share * (stop.steady[1] - stop.steady[0]));
    const inside = M_a.filter((_, k) => time[k] >= begin && time[k] <= end);
    result.plateau_torque = [inside.length && stop.steady[1] - stop.steady[0] >= SHORTEST_PLATEAU ? mean(inside) : NaN, "N.m"];
  }
  const instant = stop.end + REST, k = Math.min(Math.max(1, time.findIndex(entry => entry >= instant)), time.length - 1);
  const reached = instant <= Math.min(stop.until, time[time.length - 1]);
  result.rest_torque = [reached ? M_fr[k - 1] + (M_fr[k] - M_fr[k - 1]) / (time[k] - time[k - 1]) * (instant - time[k - 1]) : NaN, "N.m"];
  for (const [name, figure] of Object.entries(stop_figures(trace, stop, `tcp.x_${axis}`))) result[`tool.${name}`] = figure;
  return result;
}

// --- circles ----------------------------------------------------------------------------------------------------------

// The turns that an entry of `evaluate` asks for: {turn, back}, or why there is none.
function turns_of(item, segments) {
  const chosen = item.motion === null ? segments : segments.slice(item.motion, item.motion + 1);
  const circles = chosen.filter(entry => entry.kind === "circle").pop();
  if (!circles) return { problem: "circularity: the program has no circle" };
  const turns = [];
  for (const circle of circles.circles) {
    const number = item.turn, [begin, end] = circle.turns[(number || Math.floor(circle.turns.length / 2) + 1) - 1] || [0, 0];
    const [first, last] = circle.steady || [Infinity, -Infinity];
    if ((number || 0) > circle.turns.length) return { problem: `circularity: turn ${number} of a circle of ${circle.turns.length} turns` };
    if (begin >= first + RUN_IN && end <= last + 1e-9 * circle.turn_time && circle.turns.length) turns.push({ ...circle, begin, end });
    else if (!number && last - circle.turn_time >= first + RUN_IN) turns.push({ ...circle, begin: last - circle.turn_time, end: last });
    else return { problem: "circularity: no full turn is driven at constant speed; lower the feed, or give the circle more turns in the scenario" };
  }
  const axes = turns[0].axes;
  return { kind: "circle", prefix: axes.join(axes.every(entry => entry.length === 1) ? "" : "-"), axes, turn: turns[0], back: turns[1] || null };
}

const seen_contours = new WeakMap(), length_of = (x, y) => Math.sqrt(x * x + y * y); // Math.hypot takes ten times as long

// Of a turn by two columns, once for all who ask.
function contour(trace, turn, names = turn.axes.map(axis => `${axis}.x_a`)) {
  if (!seen_contours.has(trace)) seen_contours.set(trace, new Map());
  const seen = seen_contours.get(trace), key = `${turn.begin} ${names}`;
  if (!seen.has(key)) seen.set(key, contour_of(trace, turn, names));
  return seen.get(key);
}

function contour_of(trace, turn, names) {
  let [first, last] = rows_within(trace.time, turn.begin, turn.end);
  if (trace.time[last - 1] >= turn.end) last--;
  const time = trace.time.slice(first, last), [x, y] = names.map((name, i) => trace[name].slice(first, last).map(entry => entry - turn.centre[i]));
  const angle = x.map((entry, k) => Math.atan2(y[k], entry)), deviation = x.map((entry, k) => length_of(entry, y[k]) - turn.radius), middle = median(deviation);
  const glitches = [0, 1, 2, 3].map(quarter => {
    let peak = -1;
    angle.forEach((entry, k) => {
      const off = Math.abs(modulo(entry - quarter * QUARTER + Math.PI, 2 * Math.PI) - Math.PI);
      if (off <= QUARTER / 2 && (peak < 0 || deviation[k] > deviation[peak])) peak = k;
    });
    const axis = turn.axes[quarter % 2];
    return { name: axis + (quarter < 2 ? "+" : "-"), axis, angle: angle[peak], deviation: deviation[peak], height: deviation[peak] - middle };
  });
  return { time, angle, deviation, median: middle, glitches };
}
const modulo = (value, by) => ((value % by) + by) % by;

// Centre of the least-squares circle; Gauss-Newton, four passes.
function fitted_centre({ angle, deviation }, radius) {
  const x = angle.map((entry, k) => (radius + deviation[k]) * Math.cos(entry)), y = angle.map((entry, k) => (radius + deviation[k]) * Math.sin(entry));
  let p = 0, q = 0;
  for (let pass = 0; pass < 4; pass++) {
    const A = [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]];
    for (let k = 0; k < x.length; k++) {
      const d = length_of(x[k] - p, y[k] - q), row = [(x[k] - p) / d, (y[k] - q) / d, 1];
      for (let i = 0; i < 3; i++) { for (let j = 0; j < 3; j++) A[i][j] += row[i] * row[j]; A[i][3] += row[i] * (d - radius); }
    }
    for (let i = 0; i < 3; i++) for (let j = 0; j < 3; j++) if (j !== i) { const f = A[j][i] / A[i][i]; for (let k = 0; k < 4; k++) A[j][k] -= f * A[i][k]; }
    p += A[0][3] / A[0][0];
    q += A[1][3] / A[1][1];
  }
  return [p, q];
}

// Range of the distance from it.
function least_squares_deviation({ angle, deviation }, radius) {
  const [p, q] = fitted_centre({ angle, deviation }, radius), far = angle.map((entry, k) => length_of((radius + deviation[k]) * Math.cos(entry) - p, (radius + deviation[k]) * Math.sin(entry) - q));
  return largest(far) - least(far);
}

function turn_figures(trace, turn, names) {
  const measured = contour(trace, turn, names), e = measured.deviation, um = value => [value * 1e6, "um"], result = {
    G: um(largest(e) - least(e)), G_ls: um(least_squares_deviation(measured, turn.radius)), F_max: um(largest(e)), F_min: um(least(e)), mean: um(mean(e)), median: um(measured.median),
  };
  for (const axis of turn.axes) result[`glitch_${axis}`] = um(largest(measured.glitches.filter(entry => entry.axis === axis).map(entry => entry.height)));
  for (const glitch of measured.glitches) result[`glitch_${glitch.name}`] = um(glitch.height);
  return result;
}

function circularity(trace, turn) {
  const result = turn_figures(trace, turn), tool = turn_figures(trace, turn, turn.axes.map(axis => `tcp.x_${axis}`));
  for (const name in tool) result[`tool.${name}`] = tool[name];
  return result;
}

// ISO 230-4's figures of two turns in opposite senses, about the centre of the circle fitted to both.
const ANGLES = 720, spread_of = values => largest(values) - least(values);
const concatenated = parts => { const result = new Float64Array(parts.reduce((sum, part) => sum + part.length, 0)); let at = 0; for (const part of parts) { result.set(part, at); at += part.length; } return result; };
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
  return { G_b: um(spread_of(concatenated(around.map(entry => entry.deviation)))), D: um((mean(there) + mean(again)) / 2), H: um(largest(there.map((entry, k) => Math.abs(entry - again[k])))) };
}

// Linear between points with ascending x; level beyond their ends, or repeated with a period.
function interpolated(wanted, x, y, period = 0) {
  const n = x.length, X = period ? [x[n - 1] - period, ...x, x[0] + period] : x, Y = period ? [y[n - 1], ...y, y[0]] : y;
  let k = 0;
  return Float64Array.from(wanted, at => {
    if (k && at < X[k]) k = 0;
    while (k + 2 < X.length && at >= X[k + 1]) k++;
    if (at <= X[0]) return Y[0];
    if (at >= X[X.length - 1]) return Y[Y.length - 1];
    return Y[k] + (Y[k + 1] - Y[k]) / (X[k + 1] - X[k]) * (at - X[k]);
  });
}

// --- all that the scenario asks for -----------------------------------------------------------------------------------

function tasks_of(evaluate, segments, duration) {
  const result = [];
  for (const item of evaluate) {
    const task = item.kind === "positioning" ? approach_of(item, segments, duration) : turns_of(item, segments);
    if (task.problem) throw new Error(task.problem);
    const same = result.filter(entry => entry.plain === task.prefix).length;
    result.push({ ...task, plain: task.prefix, prefix: same ? `${task.prefix}#${same + 1}` : task.prefix });
  }
  return result;
}

function figures_of(trace, tasks) {
  const result = {};
  for (const task of tasks) {
    const own = task.kind === "positioning" ? positioning(trace, task) : circularity(trace, task.turn);
    if (task.back) {
      Object.assign(own, bidirectional(trace, task.turn, task.back));
      for (const [name, figure] of Object.entries(circularity(trace, task.back))) own[`clockwise.${name}`] = figure;
    }
    for (const name in own) result[`${task.prefix}.${name}`] = own[name];
  }
  return result;
}
