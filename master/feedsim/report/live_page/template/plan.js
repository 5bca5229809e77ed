// The scenario's motions as setpoints: feedsim.simulation.nc and feedsim.motions once more, for moves, circles and dwells. A test holds
// both to the same numbers.
const ON_GRID = 1e-6, REST_POINTS = 28, POINTS_PER_PHASE = 33, ROUNDING = 1e-9, BETWEEN_CIRCLES = 0.3;
const whole_cycles = (duration, cycle) => Math.max(0, Math.ceil(duration / cycle - ON_GRID));

// Fastest profile from rest to rest: at most seven phases of constant jerk, symmetric in time. Worked out for a path of length 1
// and jerk 1, so that a move of 1 nm is as accurate as one of 1 km.
function rest_to_rest(length, speed, acceleration, jerk) {
  const unit = Math.cbrt(length / jerk), V = speed * unit / length, A = acceleration * unit ** 2 / length;
  if (!(length > 0)) return { times: [0, 0], s: [0, 0], v: [0, 0], a: [0, 0], j: [0], steady: null, duration: 0, length: 0 };
  let ramp, hold, coast; // of jerk, of largest acceleration, of constant speed
  if (V >= A * A) { ramp = A; hold = V / A - A; } else { ramp = Math.sqrt(V); hold = 0; }
  const covered = V * (2 * ramp + hold);
  if (covered <= 1) coast = (1 - covered) / V;
  else {
    coast = 0;
    const peak = (Math.sqrt(A ** 4 + 4 * A) - A * A) / 2; // its speed, where the acceleration reaches A
    if (peak >= A * A) { ramp = A; hold = peak / A - A; } else { ramp = Math.cbrt(0.5); hold = 0; }
  }
  const spans = [ramp, hold, ramp, coast, ramp, hold, ramp], jerks = [1, 0, -1, 0, -1, 0, 1];
  const profile = { times: [0], s: [0], v: [0], a: [0], j: [], length };
  spans.forEach((t, k) => {
    const s = profile.s[k], v = profile.v[k], a = profile.a[k], j = jerks[k];
    profile.times.push(profile.times[k] + t);
    profile.s.push(s + t * (v + t * (a / 2 + t * j / 6)));
    profile.v.push(v + t * (a + t * j / 2));
    profile.a.push(a + t * j);
    profile.j.push(j);
  });
  profile.times = profile.times.map(entry => entry * unit);
  profile.s = profile.s.map(entry => entry * length);
  profile.s[7] = length;
  profile.v = profile.v.map(entry => entry * (length / unit));
  profile.a = profile.a.map(entry => entry * (length / unit ** 2));
  profile.j = profile.j.map(entry => entry * jerk);
  profile.duration = profile.times[7];
  profile.steady = coast > 1e-9 * (4 * ramp + 2 * hold + coast) ? [profile.times[3], profile.times[4]] : null;
  return profile;
}

function at(profile, time) {
  const t = Math.min(Math.max(time, 0), profile.duration);
  let k = 0;
  while (k < profile.j.length - 1 && t >= profile.times[k + 1]) k++;
  const dt = t - profile.times[k], j = profile.j[k], a = profile.a[k], v = profile.v[k];
  return { s: profile.s[k] + dt * (v + dt * (a / 2 + dt * j / 6)), v: v + dt * (a + dt * j / 2), a: a + dt * j };
}

function time_at(profile, s) {
  if (s <= 0) return 0;
  if (s >= profile.length) return profile.duration;
  let k = profile.j.length - 1;
  while (k > 0 && profile.s[k] >= s) k--;
  let low = profile.times[k], high = profile.times[k + 1];
  for (let n = 0; n < 60; n++) {
    const middle = (low + high) / 2;
    if (at(profile, middle).s < s) low = middle; else high = middle;
  }
  return high;
}

// --- paths ------------------------------------------------------------------------------------------------------------

function line(motion, position) {
  const origin = { ...position };
  const distance = { ...(motion.by || {}) };
  for (const axis in motion.to || {}) distance[axis] = motion.to[axis] - origin[axis];
  const length = Math.sqrt(Object.values(distance).reduce((sum, d) => sum + d * d, 0)), share = {};
  for (const axis in distance) share[axis] = length > 0 ? distance[axis] / length : 0;
  return {
    axes: Object.keys(share), length,
    place: (axis, s) => origin[axis] + share[axis] * s,
    peaks(profile) {
      const most = entry => Math.max(...entry.map(Math.abs)), peak = Math.max(...profile.v, at(profile, profile.duration / 2).v), result = {};
      for (const axis in share) {
        const ends = [origin[axis], origin[axis] + share[axis] * length];
        result[axis] = { low: Math.min(...ends), high: Math.max(...ends), speed: Math.abs(share[axis]) * peak, acceleration: Math.abs(share[axis]) * most(profile.a) };
      }
      return result;
    },
  };
}

function circular(motion, position, sense) {
  const [first, second] = motion.plane, R = motion.radius, begin = motion.start_angle;
  const centre = [position[first] - R * Math.cos(begin), position[second] - R * Math.sin(begin)], sweep = 2 * Math.PI * motion.turns;
  const angle = s => begin + sense * s / R;
  return {
    axes: motion.plane, length: R * sweep, centre, sense,
    place: (axis, s) => axis === first ? centre[0] + R * Math.cos(angle(s)) : centre[1] + R * Math.sin(angle(s)),
    peaks(profile, step) {
      const result = {}, quarter = Math.PI / 2, instants = [];
      for (const axis of motion.plane) result[axis] = { low: Infinity, high: -Infinity, speed: 0, acceleration: 0 };
      for (let k = 0; k < profile.j.length; k++) for (let i = 0; i < POINTS_PER_PHASE; i++)
        instants.push(profile.times[k] + (profile.times[k + 1] - profile.times[k]) * i / (POINTS_PER_PHASE - 1));
      for (let t = 0; t < profile.duration; t += step) instants.push(t);
      const from = sense * begin / quarter;
      for (let k = Math.ceil(from); k <= Math.floor(from + sweep / quarter); k++) instants.push(time_at(profile, (k * quarter - sense * begin) * R));
      for (const t of instants) {
        const { s, v, a } = at(profile, t), phi = angle(s), along = [-sense * Math.sin(phi), sense * Math.cos(phi)], inward = [-Math.cos(phi), -Math.sin(phi)];
        motion.plane.forEach((axis, i) => {
          const x = this.place(axis, s), peak = result[axis];
          peak.low = Math.min(peak.low, x);
          peak.high = Math.max(peak.high, x);
          peak.speed = Math.max(peak.speed, Math.abs(v * along[i]));
          peak.acceleration = Math.max(peak.acceleration, Math.abs(a * along[i] + v * v / R * inward[i]));
        });
      }
      return result;
    },
  };
}

// --- the program ------------------------------------------------------------------------------------------------------

// Points of all axes on the grid of the interpolator, what each motion is, and the limits that are not kept.
function points_of(machine, motions) {
  const { T_ipo } = machine.cycles, position = { ...machine.pose }, points = {}, segments = [], problems = [];
  for (const axis of machine.axes) points[axis] = [position[axis]];
  let instant = 0;
  const hold = (axes, cycles) => { for (const axis of axes) for (let k = 0; k < cycles; k++) points[axis].push(position[axis]); };
  const drive = (path, motion, index) => {
    const profile = rest_to_rest(path.length, motion.feed, motion.acceleration || machine.path.acceleration, motion.jerk || machine.path.jerk);
    const cycles = whole_cycles(profile.duration, T_ipo);
    if ((instant + cycles) * T_ipo > machine.longest) throw new Error(`the motions last ${((instant + cycles) * T_ipo).toPrecision(3)} s; a page shows at most ${machine.longest} s`);
    for (const axis of path.axes) for (let k = 1; k <= cycles; k++) points[axis].push(path.place(axis, at(profile, k * T_ipo).s));
    hold(machine.axes.filter(axis => !path.axes.includes(axis)), cycles);
    const peaks = path.peaks(profile, T_ipo);
    for (const axis in peaks) problems.push(...violations(machine, axis, position[axis], peaks[axis]).map(entry => `motions.${index} (${motion.kind}): ${entry}`));
    const start = instant * T_ipo;
    instant += cycles;
    return { start, end: start + profile.duration, profile, path };
  };
  motions.forEach((motion, index) => {
    const origin = { ...position }, segment = { kind: motion.kind, index, start: instant * T_ipo, origin, circles: [], axes: [] };
    if (motion.kind === "dwell") {
      const cycles = whole_cycles(motion.duration, T_ipo);
      hold(machine.axes, cycles);
      instant += cycles;
      segment.end = segment.start + motion.duration;
    } else if (motion.kind === "move") {
      const path = line(motion, position), done = drive(path, motion, index);
      for (const axis of path.axes) position[axis] = path.place(axis, path.length);
      Object.assign(position, motion.to || {});
      segment.end = done.end;
      segment.axes = path.axes.filter(axis => path.place(axis, 1) !== path.place(axis, 0));
      segment.steady = done.profile.steady && done.profile.steady.map(entry => done.start + entry);
    } else {
      const senses = motion.direction === "both" ? [1, -1] : [motion.direction === "counterclockwise" ? 1 : -1];
      senses.forEach((sense, k) => {
        if (k) {
          const pause = whole_cycles(BETWEEN_CIRCLES, T_ipo);
          hold(machine.axes, pause);
          instant += pause;
        }
        const path = circular(motion, position, sense), { start, end, profile } = drive(path, motion, index), once = 2 * Math.PI * motion.radius;
        segment.circles.push({
          axes: motion.plane, centre: path.centre, radius: motion.radius, sense,
          turns: Array.from({ length: motion.turns }, (_, n) => [n, n + 1].map(entry => start + time_at(profile, motion.radius * (2 * Math.PI * entry)))),
          steady: profile.steady && profile.steady.map(entry => start + entry), turn_time: once / Math.max(...profile.v),
        });
        segment.end = end;
      });
      segment.axes = motion.plane;
    }
    segment.target = { ...position };
    segments.push(segment);
  });
  return { points, segments, problems, instants: instant };
}

function violations(machine, axis, start, peaks) {
  const limit = machine.limits[axis], [least, most] = limit.travel, result = [], digits = (value, n) => String(Number(value.toPrecision(n)));
  const outside = [...new Set([peaks.low, peaks.high])].filter(x => x !== start && !(x >= least - ROUNDING && x <= most + ROUNDING));
  if (outside.length) result.push(`axis ${axis} reaches ${outside.map(x => digits(x * 1e3, 7)).join(" and ")} mm; allowed travel ${digits(least * 1e3, 7)} to ${digits(most * 1e3, 7)} mm`);
  if (peaks.speed > limit.speed * (1 + ROUNDING)) result.push(`axis ${axis} reaches a speed of ${digits(peaks.speed * 60, 5)} m/min; allowed at most ${digits(limit.speed * 60, 5)} m/min`);
  if (peaks.acceleration > limit.acceleration * (1 + ROUNDING)) result.push(`axis ${axis} reaches an acceleration of ${digits(peaks.acceleration, 5)} m/s^2; allowed at most ${digits(limit.acceleration, 5)} m/s^2`);
  return result;
}

// Position and slope of the C2 cubic spline through `points` a knot apart, at rest on both sides, `ratio` values per knot.
function spline(points, ratio) {
  const origin = points[0], last = points.length - 1, N = points.length + 2 * REST_POINTS;
  const x = new Float64Array(last * ratio + 1), v = new Float64Array(last * ratio + 1);
  if (points.every(entry => entry === origin)) return { x: x.fill(origin), v };
  const y = new Float64Array(N), slope = new Float64Array(N), over = new Float64Array(N);
  for (let k = 0; k < N; k++) y[k] = points[Math.min(Math.max(k - REST_POINTS, 0), last)] - origin;
  for (let k = 1; k < N - 1; k++) { // elimination of 1 4 1; the slopes at both ends are 0
    const pivot = 1 / (4 - over[k - 1]);
    over[k] = pivot;
    slope[k] = (3 * ((y[k + 1] - y[k]) + (y[k] - y[k - 1])) - slope[k - 1]) * pivot;
  }
  for (let k = N - 2; k > 0; k--) slope[k] -= over[k] * slope[k + 1];
  for (let n = 0; n < x.length; n++) {
    const knot = n / ratio, below = Math.min(Math.floor(knot), N - REST_POINTS - 2), k = below + REST_POINTS, s = knot - below;
    const rise = y[k + 1] - y[k], bend = slope[k] + slope[k + 1] - 2 * rise, half = rise - slope[k] - bend;
    x[n] = origin + (y[k] + slope[k] * s + half * (s * s) + bend * (s * s * s));
    v[n] = slope[k] + half * s * 2 + bend * (s * s) * 3;
  }
  return { x, v };
}

// Setpoints of all axes: a row x_s, n_ffw of each axis every T_pos. given: rows that the page carries, where it cannot plan.
function plan(machine, motions, given) {
  if (given) return { rows: given.rows, segments: given.segments, problems: [] };
  const { T_ipo, T_pos } = machine.cycles, { points, segments, problems, instants } = points_of(machine, motions);
  const ratio = Math.round(T_ipo / T_pos), count = instants * ratio + 1, wide = 2 * machine.axes.length, rows = new Float64Array(count * wide);
  machine.axes.forEach((axis, i) => {
    const { x, v } = spline(points[axis], ratio), I_P = machine.I_P[axis];
    for (let n = 0; n < count; n++) {
      rows[n * wide + 2 * i] = x[n];
      rows[n * wide + 2 * i + 1] = v[n] / T_ipo / I_P;
    }
  });
  return { rows, segments, problems };
}
