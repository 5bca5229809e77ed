// The model of a circle that is not round and its robust fit: feedsim.analysis.circle (model.py, geometry.py, tails.py, robust.py) once more, of turns of
// which both axes' positions are known. What is fitted, and why, stands there; a test holds both to the same digits.
const RADIANS = Math.PI / 180;
const MODEL = {
  AHEAD: 2, BEHIND: [30, 45, 60], CALM: 0.05, NEXT: 4, TAIL: 2, TAIL_FLOOR: 10e-9, DECAYS: [2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 18, 21, 25, 30], FALLEN: 2, BLOCK: 6, PASSES: 6, PITCHES: 2, FEWEST: 0.5, CLEAR_NOISE: 20e-9, POINTS: 1024, REPEATS: 2,
  KNOWN: 0.1, WOUND: 0.02, SPEED_SHARE: 0.005, RISE_SPEED: 0.012, RISE_SPREAD: 0.5, CURVATURE: 0.5, CLEARER: 0.5, DIFFERENCE: 1.5, PLAY: 0.2e-6, TURNS: 10, PERIOD: 2048,
  MOST: 8000, BIWEIGHT: 4.685, SETTLED: 1e-13, UNUSUAL: 0.6745,
};

const sign_of = value => value > 0 ? 1 : value < 0 ? -1 : 0;
const concatenated = parts => { const result = new Float64Array(parts.reduce((sum, part) => sum + part.length, 0)); let at = 0; for (const part of parts) { result.set(part, at); at += part.length; } return result; };
const split_like = (values, parts) => { let at = 0; return parts.map(part => values.slice(at, at += part.length)); };
const enough_pitches = (circle, axis, pitches = MODEL.PITCHES) => axis in circle.pitch && 2 * circle.radius >= pitches * circle.pitch[axis];

// circle: {axes, radius, speed, pitch, gain, drag, following, response}; paths: {angle, deviation, sense, phase}.
function fit_circle(circle, paths, students) {
  const result = fit_lost(circle, paths, students, false);
  if (!result.left_out.some(axis => enough_pitches(circle, axis, result.noise < MODEL.CLEAR_NOISE ? MODEL.PITCHES : MODEL.FEWEST))) return result;
  const other = fit_lost(circle, paths, students, true);
  if (other.noise < MODEL.CLEARER * result.noise) return other;
  if (!result.left_out.some(axis => enough_pitches(circle, axis))) return result;
  const moved = result.names.map(name => MODEL.DIFFERENCE * (result.of(name) - other.of(name)));
  return { ...result, covariance: result.covariance.map((row, i) => row.map((entry, j) => entry + moved[i] * moved[j])) };
}

function fit_lost(circle, paths, students, pitches) {
  const result = fit_calm(circle, paths, students, false, pitches);
  if (Math.max(result.of("lost_0"), result.of("lost_1")) < MODEL.PLAY) return result;
  const other = fit_calm(circle, paths, students, true, pitches);
  return behind(other) < behind(result) ? other : result;
}

// What is left behind the reversals, in squares.
const behind = result => result.residual.reduce((sum, off, p) => off.reduce((own, entry, k) => own + (result.reversal[p][k] >= 0 ? entry * entry : 0), sum), 0);

function fit_calm(circle, paths, students, play, pitches) {
  let result = null;
  for (const degrees of MODEL.BEHIND) {
    result = fit_windowed(circle, paths, degrees * RADIANS, students, play, pitches);
    if (calm(result)) break;
  }
  return result;
}

function fit_windowed(whole, paths, window, students, play, pitches) {
  const known = whole.axes.every(axis => axis in whole.drag), asked = whole.axes.filter(axis => axis in whole.pitch), free = known && !pitches ? whole.radius * (Math.PI / 2 - window - MODEL.AHEAD * RADIANS) : Infinity;
  const circle = { ...whole, pitch: Object.fromEntries(Object.entries(whole.pitch).filter(([axis, pitch]) => MODEL.REPEATS * pitch <= free && enough_pitches(whole, axis, pitches ? MODEL.FEWEST : MODEL.PITCHES))) };
  const both = new Set(paths.map(path => path.sense)).size === 2, count = paths.reduce((sum, path) => sum + path.angle.length, 0);
  let values = play ? { play: 1 } : {}, tails = { columns: [], spread: [] }, residual = null, undone, parts, windows, names, matrix, robust, kept, blocks;
  for (let number = 0; number < MODEL.PASSES; number++) {
    undone = paths.map(path => undo(circle, path, values));
    parts = undone.map((entry, k) => columns_of(circle, entry, paths[k].sense, both, values));
    windows = undone.map((entry, k) => windows_of(entry, paths[k].sense, window));
    names = Object.keys(parts[0]);
    matrix = names.map(name => concatenated(parts.map(part => part[name])));
    const deviation = concatenated(undone.map(entry => entry.deviation)), which = concatenated(windows.map(entry => entry.which)), since = concatenated(windows.map(entry => entry.since));
    if (number === 2) {
      const around = usual(undone.map(entry => entry.angle), split_like(residual, paths.map(path => path.angle)), windows.map(entry => entry.which));
      tails = known ? known_tails(circle, undone, paths, residual, which) : tails_of(undone, paths, left_of(residual, which, since, window, around), window, count);
    }
    const rows = rows_where(which, entry => entry < 0), taken = column => Float64Array.from(rows, k => column[k]);
    blocks = numbered(taken(concatenated(undone.map((entry, k) => entry.angle.map(angle => 1000 * k + Math.floor(angle / (MODEL.BLOCK * RADIANS)))))));
    kept = [...matrix, ...tails.columns].map(taken);
    robust = robust_fit(kept, taken(deviation), tails.spread, blocks);
    const step = robust.values.slice(0, names.length);
    values = { ...values, ...Object.fromEntries(names.map((name, i) => [name, (values[name] || 0) + step[i]])) };
    const made = combined(matrix, step, count);
    residual = deviation.map((entry, k) => entry - made[k]);
    if (number > 1 && largest(step.map(Math.abs)) < MODEL.SETTLED) { robust.rows = rows; break; }
    robust.rows = rows;
  }
  const tail = combined(tails.columns, robust.values.slice(names.length), count);
  // Positions of a run are not rounded: what rounding of a record adds is no part of it here.
  const { covariance, free: freedom } = covariance_of(kept, Float64Array.from(robust.rows, k => residual[k] - tail[k]), robust, tails.spread, blocks);
  const reversal = concatenated(windows.map(entry => entry.which)), peak = i => residual.reduce((most, entry, k) => reversal[k] >= 0 && reversal[k] % 2 === i ? Math.max(most, Math.abs(entry)) : most, 0);
  const wound = known ? { lost_0: MODEL.WOUND * peak(0), lost_1: MODEL.WOUND * peak(1) } : {};
  return {
    wound, names, values: names.map(name => values[name]), covariance, freedom, student: student(freedom, students), tails: tails.columns, angle: undone.map(entry => entry.angle), residual: split_like(residual, paths.map(path => path.angle)), window, noise: robust.noise,
    reversal: windows.map(entry => entry.which), since: windows.map(entry => entry.since), tail: split_like(tail, paths.map(path => path.angle)), columns: parts,
    left_out: asked.filter(axis => !enough_pitches(circle, axis)), unsure: known ? Math.hypot(MODEL.KNOWN * largest([0, ...Array.from(robust.rows, k => Math.abs(tail[k]))]), MODEL.SPEED_SHARE * Math.max(peak(0), peak(1))) : 0, of: name => names.includes(name) ? values[name] : 0,
  };
}

const rows_where = (values, fits) => { const result = []; for (let k = 0; k < values.length; k++) if (fits(values[k], k)) result.push(k); return result; };

// Half of the interval of a term; of an amplitude with two parts, along its direction.
function half_of(result, ...names) {
  const rows = names.map(name => result.names.indexOf(name)), part = rows.map(row => result.values[row]), length = rows.length === 2 ? Math.hypot(...part) : 0;
  const along = length > 0 ? part.map(entry => entry / length) : rows.map(() => 1 / Math.sqrt(rows.length));
  let sum = 0;
  rows.forEach((i, a) => rows.forEach((j, b) => { sum += along[a] * result.covariance[i][j] * along[b]; }));
  const half = Math.hypot(result.student * Math.sqrt(Math.max(sum, 0)), result.unsure, result.wound[names[0]] || 0);
  return rows.length === 2 && length < pair_quantile(result.freedom) * half / result.student ? Math.max(half, length) : half;
}

// Standard deviation of the model's own deviation where it is known least well, behind the reversals.
function rest_error(result) {
  let worst = 0;
  const row = new Float64Array(result.names.length), covariance = result.covariance;
  result.reversal.forEach((which, p) => {
    const columns = result.names.map(name => result.columns[p][name]);
    for (let k = 0; k < which.length; k++) {
      if (which[k] < 0) continue;
      for (let i = 0; i < row.length; i++) row[i] = columns[i][k];
      let sum = 0;
      for (let i = 0; i < row.length; i++) for (let j = 0; j < row.length; j++) sum += row[i] * covariance[i][j] * row[j];
      worst = Math.max(worst, sum);
    }
  });
  return Math.sqrt(worst);
}

function undo(circle, path, values) {
  const of = name => values[name] || 0, R = circle.radius, r = of("radius") / R, k = of("scale") / R, q = (of("squareness") + path.sense * of("servo")) / R;
  const a = 1 + r + k, d = 1 + r - k, determinant = a * d - q * q, turned = [Math.atan2(q, a), Math.atan2(d, q)], n = path.angle.length;
  const x = path.angle.map((entry, i) => (R + path.deviation[i]) * Math.cos(entry)), y = path.angle.map((entry, i) => (R + path.deviation[i]) * Math.sin(entry));
  const p = [x.map(entry => entry - of("offset_0")), y.map(entry => entry - of("offset_1"))], angle = p[0].map((entry, i) => Math.atan2(p[1][i], entry));
  for (const [name, [axis, displacement]] of Object.entries(displacements(circle, angle, [x, y], path.sense, turned, values))) {
    const value = of(name);
    if (value) for (let i = 0; i < n; i++) p[axis][i] -= value * displacement[i];
  }
  const deviation = new Float64Array(n), plain = new Float64Array(n);
  for (let i = 0; i < n; i++) {
    const u = (d * p[0][i] - q * p[1][i]) / determinant, v = (a * p[1][i] - q * p[0][i]) / determinant;
    plain[i] = Math.atan2(v, u);
    deviation[i] = length_of(u, v) - R;
  }
  return { positions: [x, y], angle: plain, deviation, turned };
}

// Play of `values` is used up behind a reversal before it is lost.
function displacements(circle, angle, positions, sense, turned, values) {
  const result = {};
  for (const i of [0, 1]) {
    const lost = values.play ? values[`lost_${i}`] || 0 : 0, part = entry => lost > 0 ? Math.min(Math.max(circle.radius * (1 - Math.cos(modulo(sense * (entry - turned[i]), Math.PI))) / lost - 0.5, -0.5), 0.5) : 0.5;
    result[`lost_${i}`] = [i, angle.map(entry => sense * sign_of(Math.sin(entry - turned[i])) * part(entry))];
  }
  circle.axes.forEach((axis, i) => {
    if (!(axis in circle.pitch)) return;
    const [cos, sin] = followed(circle, i, angle, positions[i], sense);
    result[`pitch_${i}_cos`] = [i, cos];
    result[`pitch_${i}_sin`] = [i, sin];
  });
  return result;
}

// What an axis does of errors of its measured position that repeat with the pitch, as far as its loops follow them.
function followed(circle, i, angle, positions, sense) {
  const axis = circle.axes[i], rate = 2 * Math.PI / circle.pitch[axis], following = circle.following[axis], n = MODEL.POINTS, step = 2 * Math.PI / n;
  if (!following) return [Math.cos, Math.sin].map(wave => positions.map(entry => wave(rate * entry)));
  const way = Float64Array.from({ length: n }, (_, k) => rate * circle.radius * (i ? Math.sin : Math.cos)(k * step));
  return [Math.cos, Math.sin].map((wave, part) => {
    const course = responded(way.map(wave), following, true), back = part && i ? sense : 1;
    return angle.map(entry => back * at_angle(course, sense * entry));
  });
}

// A course over a turn through a response at the multiples of its rate; its mean is kept, or nothing of it.
function responded(course, response, level) {
  const n = course.length, re = Float64Array.from(course), im = new Float64Array(n);
  transform(re, im, 1);
  if (!level) re[0] = im[0] = 0;
  for (let k = 1; k < n; k++) {
    const [a, b] = response[Math.min(k, n - k) - 1] || NONE, c = 2 * k < n ? b : -b, u = re[k], v = im[k];
    re[k] = 2 * k === n ? 0 : u * a - v * c;
    im[k] = 2 * k === n ? 0 : u * c + v * a;
  }
  transform(re, im, -1);
  return re.map(entry => entry / n);
}

// A course over a turn at an angle, linear between its points.
function at_angle(course, angle) {
  const n = course.length, at = modulo(angle, 2 * Math.PI) / (2 * Math.PI / n), low = Math.floor(at), part = at - low;
  return course[low % n] * (1 - part) + course[(low + 1) % n] * part;
}

function columns_of(circle, undone, sense, both, values) {
  const { angle } = undone, along = [angle.map(Math.cos), angle.map(Math.sin)], oblique = angle.map(entry => Math.sin(2 * entry));
  const result = { offset_0: along[0], offset_1: along[1], radius: angle.map(() => 1), scale: angle.map(entry => Math.cos(2 * entry)), squareness: oblique };
  if (both) result.servo = oblique.map(entry => sense * entry);
  for (const [name, [axis, displacement]] of Object.entries(displacements(circle, angle, undone.positions, sense, undone.turned, values))) result[name] = displacement.map((entry, k) => along[axis][k] * entry);
  return result;
}

function windows_of(undone, sense, window) {
  const n = undone.angle.length, which = new Float64Array(n).fill(-1), since = new Float64Array(n).fill(Infinity);
  for (let k = 0; k < 4; k++) {
    const at = undone.turned[k % 2] + (k > 1 ? Math.PI : 0);
    for (let i = 0; i < n; i++) {
      const passed = modulo(sense * (undone.angle[i] - at) + Math.PI, 2 * Math.PI) - Math.PI;
      if (passed >= -MODEL.AHEAD * RADIANS && passed < window) { which[i] = k; since[i] = passed; }
    }
  }
  return { which, since };
}

// Standard deviation of the means over NEXT of what is left between the windows.
function usual(angles, residuals, reversals) {
  const around = [];
  angles.forEach((angle, p) => {
    const rows = rows_where(reversals[p], entry => entry < 0), { sums, counts } = by_block(numbered(rows.map(k => Math.floor(angle[k] / (MODEL.NEXT * RADIANS)))), rows.map(k => residuals[p][k]));
    sums.forEach((sum, k) => around.push(sum / counts[k]));
  });
  return absolute_median(around) / MODEL.UNUSUAL;
}

// What the peak at each half axis leaves at the end of its window, and the angle in which that falls to 1/e.
function left_of(residual, which, since, window, around) {
  const width = MODEL.FALLEN * RADIANS, decays = MODEL.DECAYS.map(entry => entry * RADIANS), result = [[0, 0], [0, 0], [0, 0], [0, 0]];
  for (const axis of [0, 1]) {
    const sizes = {}, errors = {};
    for (const k of [axis, axis + 2]) {
      const own = rows_where(which, (entry, i) => entry === k && since[i] > 0), { sums, counts } = by_block(own.map(i => Math.floor(since[i] / width)), own.map(i => residual[i] / Math.cos(since[i])));
      let means = sums.map((sum, i) => sum / Math.max(counts[i], 1));
      const top = means.reduce((best, entry, i) => Math.abs(entry) > Math.abs(means[best]) ? i : best, 0);
      if (!means.length || Math.abs(means[top]) <= MODEL.NEXT * around) continue;
      const sense = sign_of(means[top]);
      means = means.map(entry => sense * entry);
      let first = top;
      while (first < means.length && !(means[first] < 0.5 * means[top])) first++;
      if (means.length - first < 3) continue;
      const middle = mean(means.slice(first)), left = means.slice(first).map(entry => entry - middle);
      sizes[k] = [];
      errors[k] = [];
      for (const decay of decays) {
        const raw = left.map((_, i) => Math.exp((window - (first + i + 0.5) * width) / decay)), level = mean(raw), tail = raw.map(entry => entry - level), size = dot(tail, left) / dot(tail, tail);
        sizes[k].push(size);
        errors[k].push(mean(left.map((entry, i) => (entry - size * tail[i]) ** 2)));
      }
    }
    const sums = decays.map((_, i) => Object.values(errors).reduce((sum, entry) => sum + entry[i], 0)), best = sums.indexOf(least(sums));
    for (const k in sizes) if (sizes[k][best] > Math.sqrt(errors[k][best])) result[k] = [sizes[k][best], decays[best]];
  }
  return result;
}

function tails_of(undone, paths, left, window, count) {
  const columns = [], spread = [];
  left.forEach(([size, decay], k) => {
    if (size < MODEL.TAIL_FLOOR) return;
    const wave = k % 2 === 0 ? Math.cos : Math.sin;
    columns.push(concatenated(undone.map((entry, p) => entry.angle.map(angle => {
      const since = modulo(paths[p].sense * (angle - entry.turned[k % 2] - (k > 1 ? Math.PI : 0)), 2 * Math.PI);
      return since < Math.PI ? Math.abs(wave(angle)) * Math.exp((window - since) / decay) : 0;
    }))));
    spread.push(MODEL.TAIL * size);
  });
  return { columns, spread };
}

// Where the loops' response is known: of each axis the periodic response to its friction, its first two slopes, and that to
// friction that rises with the speed.
function known_tails(circle, undone, paths, residual, which) {
  const columns = [], spread = [], step = 2 * Math.PI / MODEL.PERIOD, within = MODEL.TURNS * RADIANS;
  circle.axes.forEach((axis, i) => {
    const peak = largest([0, ...residual.filter((_, k) => which[k] >= 0 && which[k] % 2 === i).map(Math.abs)]);
    if (peak < MODEL.TAIL_FLOOR) return;
    const courses = [0, 1, 2, 3].map(() => new Float64Array(MODEL.PERIOD)), rising = new Float64Array(MODEL.PERIOD), none = new Float64Array(MODEL.PERIOD);
    for (let n = 0; n < MODEL.PERIOD; n++) { const v = Math.sin(step * n); rising[n] = sign_of(v) * Math.log1p(circle.speed / MODEL.RISE_SPEED * Math.abs(v)); }
    transform(rising, none, 1);
    circle.drag[axis].forEach(([re, im], at) => {
      const k = 2 * at + 1;
      for (let n = 0; n < MODEL.PERIOD; n++) {
        const c = Math.cos(step * ((k * n) % MODEL.PERIOD)), s = Math.sin(step * ((k * n) % MODEL.PERIOD)), along = (re * c - im * s) / k, across = (re * s + im * c) / k;
        courses[0][n] += across;
        courses[1][n] += k * along;
        courses[2][n] -= k * k * across;
        courses[3][n] -= Math.PI / (2 * MODEL.PERIOD) * none[k] * k * across;
      }
    });
    const whole = largest(courses[0].map(Math.abs)), wave = [Math.cos, Math.sin][i];
    [MODEL.TAIL, within, within ** 2, MODEL.RISE_SPREAD].forEach((size, order) => {
      columns.push(concatenated(undone.map((entry, p) => entry.angle.map(angle => wave(angle) * at_angle(courses[order], paths[p].sense * (angle - entry.turned[i])) / whole))));
      spread.push(size * peak);
    });
  });
  return { columns, spread };
}

// Whether the peaks have died away where their windows end, as far as noise and what else is left let one see.
function calm(result) {
  const off = result.residual.map((residual, p) => residual.map((entry, k) => entry - result.tail[p][k])), around = usual(result.angle, off, result.reversal);
  return result.angle.every((angle, p) => [0, 1, 2, 3].every(k => {
    const own = rows_where(result.reversal[p], entry => entry === k);
    if (!own.length) return true;
    const last = angle[own.reduce((best, i) => result.since[p][i] > result.since[p][best] ? i : best, own[0])];
    const next = rows_where(result.reversal[p], (entry, i) => entry < 0 && Math.abs(modulo(angle[i] - last + Math.PI, 2 * Math.PI) - Math.PI) < MODEL.NEXT * RADIANS);
    if (!next.length) return true;
    return Math.abs(mean(next.map(i => off[p][i]))) <= Math.max(MODEL.CALM * largest(own.map(i => Math.abs(off[p][i]))), 4 * around);
  }));
}

// --- the fit ----------------------------------------------------------------------------------------------------------

// What is known of the last values beforehand, an inverse covariance, times `factor`, added to a matrix.
function with_known(matrix, spread, factor) {
  const first = matrix.length - spread.length;
  spread.forEach((entry, i) => { matrix[first + i][first + i] += factor / entry ** 2; });
  return matrix;
}

function robust_fit(columns, deviation, spread, blocks) {
  const n = deviation.length;
  let weights = new Float64Array(n).fill(1), slopes = weights, shared = 0, values = null, noise = 0;
  for (let pass = 0; pass < MODEL.PASSES; pass++) {
    const weighted = deviation.map((entry, k) => weights[k] * entry);
    values = times(pseudo_inverse(with_known(normal_matrix(columns, weights), spread, shared ** 2)), columns.map(column => dot(column, weighted)));
    const made = combined(columns, values, n), off = deviation.map((entry, k) => entry - made[k]);
    noise = absolute_median(off) / MODEL.UNUSUAL;
    if (noise < MODEL.SETTLED) break;
    const reach = MODEL.BIWEIGHT * noise;
    if (spread.length) {
      const { sums } = by_block(blocks, off.map(entry => Math.min(Math.max(entry, -reach), reach)));
      shared = Math.max(noise, Math.sqrt(dot(sums, sums) / n));
    }
    let most = 0;
    const before = weights, inner = off.map(entry => Math.max(1 - (entry / reach) ** 2, 0));
    weights = inner.map((entry, k) => { most = Math.max(most, Math.abs(entry ** 2 - before[k])); return entry ** 2; });
    slopes = inner.map(entry => entry * (5 * entry - 4));
    if (most < 0.01) break;
  }
  return { values, weights, slopes, noise, shared };
}

// Every direction of the second derivatives at least CURVATURE of the weighted normal matrix.
function bounded(curved, weighted) {
  const { values, vectors } = eigen(weighted), most = largest(values), usable = rows_where(values, entry => entry > 1e-14 * most), scaled_by = power => vectors.map(row => Float64Array.from(usable, k => row[k] * values[k] ** power));
  const inverse = scaled_by(-0.5), shares = eigen(product(product(transposed(inverse), curved), inverse));
  if (least(shares.values) >= MODEL.CURVATURE) return curved;
  const along = product(scaled_by(0.5), shares.vectors);
  return product(along.map(row => row.map((entry, k) => entry * Math.max(shares.values[k], MODEL.CURVATURE))), transposed(along));
}

// Covariance of the free values, and its degrees of freedom.
function covariance_of(columns, residual, robust, spread, blocks) {
  const terms = columns.length, own = terms - spread.length, known = with_known(Array.from({ length: terms }, () => new Float64Array(terms)), spread, robust.shared ** 2);
  const prior = weights => with_known(normal_matrix(columns, weights), spread, robust.shared ** 2), inverse = pseudo_inverse(bounded(prior(robust.slopes), prior(robust.weights)), 1e-15), influence = residual.map((entry, k) => robust.weights[k] * entry);
  const sums = columns.map(column => by_block(blocks, column.map((entry, k) => influence[k] * entry)).sums), count = sums[0].length, free = Math.max(count - own, 2);
  const around = inner => product(product(inverse, inner), inverse), single = around(normal_matrix(columns, influence.map(entry => entry ** 2))), blockwise = around(normal_matrix(sums)), besides = around(known);
  const part = count / free, scale = single.map((row, i) => Math.sqrt(Math.max(row[i] / Math.max(blockwise[i][i] * part, 1e-300), 1)));
  return { covariance: blockwise.map((row, i) => row.map((entry, j) => scale[i] * entry * part * scale[j] + robust.shared ** 2 * besides[i][j])), free };
}

// Radius, in standard deviations, of the circle that holds 95 % of two values.
const pair_quantile = free => Math.sqrt(free * Math.expm1(Math.log(20) * 2 / free));

// Quantile 0.975 of Student's distribution; of few degrees of freedom from a table that the page carries (from 2 on).
function student(free, students) {
  if (free - 2 < students.length) return students[free - 2];
  const z = 1.959963984540054;
  return [z, (z ** 3 + z) / 4, (5 * z ** 5 + 16 * z ** 3 + 3 * z) / 96, (3 * z ** 7 + 19 * z ** 5 + 17 * z ** 3 - 15 * z) / 384, (79 * z ** 9 + 776 * z ** 7 + 1482 * z ** 5 - 1920 * z ** 3 - 945 * z) / 92160]
    .reduce((sum, term, k) => sum + term / free ** k, 0);
}
