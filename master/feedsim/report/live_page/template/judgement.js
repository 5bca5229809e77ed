// Whether the loops of a machine are stable, with what margins, and at which gains they would be: feedsim.linear.judgement once more,
// and what feedsim.simulation.judge says of it. Method and numbers stand there; a test holds both to the same words.
const JUDGED = { GAIN_MARGIN: 10 ** (6 / 20), PHASE_MARGIN: 30, STEP: 0.05, ABOUT: [-5, -2.4, -1.3, -0.7, -0.3, 0, 0.3, 0.7, 1.3, 2.4, 5], SHOWS: 0.03, WITHIN: [1e-2, 1e2], IMAGES: 1, SECTOR: 1, COUNTS: 8, CHANGE: 0.2, TURN: 0.6, ROUNDS: 12, GROWTH: 1e-2, REAL: 1e-3, TINY: 2.2250738585072014e-308 };
const GAINS = Array.from({ length: 2401 }, (_, k) => 10 ** (-6 + k / 200)), STATES = ["moving", "at rest"];
const far = factor => Math.abs(Math.log(factor));
const geometric = (from, to, count, whole = true) => Array.from({ length: count }, (_, k) => from * (to / from) ** (k / (whole ? count - 1 : count)));

// All loops of a system in both states; null where `between` ends it. locked: [omega, damping, peak per K_v] of modes with motors held.
async function judge(system, locked, between) {
  const { T_c, T_pos } = system.machine.cycles, result = [];
  const speed = await along(system, s => speed_level(system, s), frequencies(0.5 / T_c, free_resonances(system)), between);
  const position = speed && await along(system, s => position_level(system, s), frequencies(0.5 / T_pos, locked_resonances(system, locked)), between);
  if (!position) return null;
  STATES.forEach((state, k) => {
    const of_speed = -windings(speed.map(entry => entry[k][0])), closed = of_speed - windings(position.map(entry => entry[k][0]));
    system.axes.forEach((axis, i) => {
      for (const [kind, level, gain, growing, inner] of [["speed", speed, system.drives[i].K_p, of_speed, 0], ["position", position, system.drives[i].K_v, closed, of_speed]])
        if (gain > 0) result.push(judged(axis, kind, state, gain, level.map(entry => less(over(entry[k][0], entry[k][1 + i]), ONE)), growing, closed, inner));
    });
  });
  return result;
}

function judged(axis, kind, state, gain, L, growing, closed, inner) {
  const near = limits_of(L, JUDGED.WITHIN), gain_margin = gain_margin_of(near, 1), phase_margin = phase_margin_of(L, 1), base = { axis, kind, state, gain, growing: closed };
  const nearest = factors => factors.length ? factors.reduce((best, entry) => far(entry) < far(best) ? entry : best) : null, of_gain = factor => factor === null ? null : gain * factor;
  if (!growing && gain_margin >= JUDGED.GAIN_MARGIN && phase_margin >= JUDGED.PHASE_MARGIN) return { ...base, unstable: false, limit: of_gain(nearest(near)), gain_margin, phase_margin, advised: gain, thin: false };
  const limits = limits_of(L, [GAINS[0], GAINS[GAINS.length - 1]]), ends = [GAINS[0], ...limits, GAINS[GAINS.length - 1]], winds = windings(L.map(entry => plus(ONE, entry)));
  const counts = ends.slice(1).map((end, k) => growing + winds - windings(L.map(entry => plus(ONE, scaled(Math.sqrt(end * ends[k]), entry))))), fewest_count = Math.min(...counts, growing + winds), fewest = counts.map(entry => entry === fewest_count);
  const unstable = growing > fewest_count && !inner;
  if (growing && !unstable) return { ...base, unstable: false, limit: null, gain_margin: Infinity, phase_margin: 180, advised: null, thin: false };
  const good = [...GAINS].sort((a, b) => far(a) - far(b)).filter(k => { let at = 0; while (at < limits.length && limits[at] < k) at++; return fewest[at]; });
  const edges = ends.filter((_, k) => k > 0 && k < ends.length - 1 && fewest[k - 1] !== fewest[k]);
  const advised = good.find(k => gain_margin_of(limits, k) >= JUDGED.GAIN_MARGIN && phase_margin_of(L, k) >= JUDGED.PHASE_MARGIN);
  return { ...base, unstable, limit: of_gain(nearest(unstable ? edges : limits)), gain_margin, phase_margin, advised: advised === undefined ? null : gain * advised, thin: !unstable && (gain_margin < JUDGED.GAIN_MARGIN || phase_margin < JUDGED.PHASE_MARGIN) };
}

const below_zero = value => value < 0 || Object.is(value, -0);

// Factors on an open-loop gain, ascending, that take it through -1, between two.
function limits_of(L, [low, high]) {
  const result = [];
  for (let k = 0; k + 1 < L.length; k++) {
    const a = angle_of(scaled(-1, L[k])), b = angle_of(scaled(-1, L[k + 1])), turn = b - a;
    if (below_zero(a) === below_zero(b) || !(Math.abs(turn) < Math.PI)) continue;
    const size = Math.log(Math.max(size_of(L[k]), JUDGED.TINY)), next = Math.log(Math.max(size_of(L[k + 1]), JUDGED.TINY)), factor = Math.exp(-(size - a / turn * (next - size)));
    if (factor > low && factor < high) result.push(factor);
  }
  // Half the sampling rate: the mirror image of the contour meets it there.
  const end = L[L.length - 1], last = 1 / Math.max(size_of(end), JUDGED.TINY);
  if (Math.abs(angle_of(scaled(-1, end))) < JUDGED.REAL && last > low && last < high) result.push(last);
  return result.sort((a, b) => a - b);
}

const gain_margin_of = (limits, factor) => limits.length ? Math.exp(Math.min(...limits.map(entry => Math.abs(Math.log(entry / factor))))) : Infinity;

function phase_margin_of(L, factor) {
  let result = 180;
  for (let k = 0; k + 1 < L.length; k++) {
    const size = Math.log(Math.max(size_of(L[k]) * factor, JUDGED.TINY)), next = Math.log(Math.max(size_of(L[k + 1]) * factor, JUDGED.TINY));
    if ((next < 0) === (size < 0)) continue;
    const angle = angle_of(scaled(-1, L[k])) + size / (size - next) * angle_of(over(L[k + 1], L[k]));
    result = Math.min(result, Math.abs(modulo(angle + Math.PI, 2 * Math.PI) - Math.PI) * 180 / Math.PI);
  }
  return result;
}

// How often values along half the contour, whose other half is the mirror image, wind around 0.
function windings(values) {
  let sum = 0;
  for (let k = 0; k + 1 < values.length; k++) sum += angle_of(over(values[k + 1], values[k]));
  return half_even(sum / Math.PI);
}

// Determinants of a level along half its contour, close enough together that none jumps: per frequency, per state.
async function along(system, level, frequency, between) {
  let begun = Date.now();
  const evaluated = async list => {
    const result = [];
    for (const f of list) {
      result.push(level([JUDGED.GROWTH, 2 * Math.PI * f]));
      if (between && Date.now() - begun > 15) { if (!(await between())) return null; begun = Date.now(); }
    }
    return result;
  };
  let values = await evaluated(frequency);
  if (!values) return null;
  if (values.some(states => states.some(entry => entry.some(pair => !Number.isFinite(pair[0]) || !Number.isFinite(pair[1])))))
    throw new Error(`the loops are beyond all numbers that a computer has; K_p [N.m.s/rad], ${system.axes.map((axis, i) => `axis ${axis}: ${general(system.drives[i].K_p, 3)}`).join(", ")}`);
  for (let round = 0; round < JUDGED.ROUNDS; round++) {
    const gains = values.map(states => states.map(([all, ...open]) => open.map(entry => less(over(all, entry), ONE)))), wide = [];
    const counts = L => { const size = size_of(L); return Math.abs(angle_of(scaled(-1, L))) < JUDGED.SECTOR && size > 1 / JUDGED.COUNTS && size < JUDGED.COUNTS; };
    for (let k = 0; k + 1 < frequency.length; k++) {
      const turns = values[k].some((entry, state) => entry.some((value, i) => Math.abs(angle_of(over(values[k + 1][state][i], value))) > JUDGED.TURN));
      if (turns || gains[k].some((entry, state) => entry.some((L, i) => { const next = gains[k + 1][state][i]; return size_of(less(next, L)) > JUDGED.CHANGE * size_of(next) && (counts(next) || counts(L)); }))) wide.push(k);
    }
    if (!wide.length) break;
    const middles = wide.map(k => 0.5 * (frequency[k] + frequency[k + 1])), made = await evaluated(middles), more_f = [], more = [];
    if (!made) return null;
    let at = 0;
    frequency.forEach((f, k) => {
      more_f.push(f);
      more.push(values[k]);
      if (wide[at] === k) { more_f.push(middles[at]); more.push(made[at++]); }
    });
    [frequency, values] = [more_f, more];
  }
  return values;
}

function frequencies(highest, near) {
  const all = [0, ...geometric(JUDGED.GROWTH * 1e-2, 1, 30, false), ...geometric(1, highest, Math.ceil(Math.log(highest) / JUDGED.STEP)), ...near.filter(f => f > 0 && f < highest)];
  return [...new Set(all)].sort((a, b) => a - b);
}

const about = list => list.filter(([, , peak]) => peak > JUDGED.SHOWS).flatMap(([omega, damping]) => JUDGED.ABOUT.map(entry => (omega + Math.max(damping * omega, JUDGED.GROWTH) * entry) / (2 * Math.PI)));

function free_resonances({ axes, machine, drives, plant: { table: { omega_0, damping, rotor, scale } } }) {
  const result = [];
  omega_0.forEach((omega, mode) => {
    if (!(omega > 0)) return;
    const seen = Math.max(...axes.map((axis, i) => Math.max(Math.abs(rotor[i][mode]), Math.abs(scale[i][mode]) / machine.I_P[axis]))), driven = Math.max(...drives.map((drive, i) => Math.abs(rotor[i][mode]) * drive.K_p));
    result.push([omega, damping[mode], seen * driven / Math.max(2 * damping[mode] * omega, JUDGED.GROWTH)]);
  });
  return about(result);
}

function locked_resonances({ drives }, locked) {
  const K_v = Math.max(...drives.map(drive => drive.K_v));
  return about(locked.map(([omega, damping, peak]) => [omega, damping, K_v * peak]));
}

// Per state, at s: measured positions per torque, what the speed loops take off the torques, and what of that is the motor's own.
function speed_loops(system, s) {
  const { motor, friction } = system.ports(s), { T_c } = system.machine.cycles, torques = system.drives.map(drive => drive.torque(s));
  return STATES.map(state => {
    let { n, x } = motor;
    if (state === "at rest") {
      const angle = scaled(0.5 * T_c, over(plus(exponential(scaled(T_c, s)), ONE), exponential_less_1(scaled(T_c, s)))), R = system.bristles.map(entry => plus(scaled(entry.stiffness, angle), [entry.damping, 0]));
      n = solved(with_one(friction.n.map(row => row.map((entry, j) => mul(entry, R[j])))), motor.n).x;
      const held = matrix_product(friction.x, n.map((row, i) => row.map(entry => mul(R[i], entry))));
      x = motor.x.map((row, i) => row.map((entry, j) => less(entry, held[i][j])));
    }
    const { loop, measured } = system.torque_loop(s, torques, n, x);
    return { measured, loop, fixed: n.map((row, i) => row.map(entry => mul(torques[i][1], entry))), torques };
  });
}

// Determinant of 1 + loop, and of that with each row in turn taken from `opened`.
const determinants = (loop, opened) => [loop, ...loop.map((_, i) => loop.map((row, j) => i === j ? opened[i] : row))].map(entry => solved(with_one(entry), null).determinant);

const speed_level = (system, s) => speed_loops(system, s).map(({ loop, fixed }) => determinants(loop, fixed));

function position_level(system, s) {
  const m = system.drives[0].ticks, { T_pos } = system.machine.cycles, components = m > 2 * JUDGED.IMAGES ? [-1, 0, 1] : Array.from({ length: m }, (_, k) => k), sums = STATES.map(() => system.axes.map(() => system.axes.map(() => NONE)));
  for (const component of components) {
    const at = [s[0], s[1] + 2 * Math.PI * component / T_pos], answer = system.drives.map(drive => mul(drive.from_setpoint(at), drive.ramp(at)));
    speed_loops(system, at).forEach(({ measured, loop, torques }, state) => {
      const given = system.axes.map((_, i) => system.axes.map((__, j) => i === j ? mul(torques[i][0], answer[i]) : NONE));
      sums[state] = matrix_product(measured, solved(with_one(loop), given).x).map((row, i) => row.map((entry, j) => plus(sums[state][i][j], entry)));
    });
  }
  return sums.map(sum => determinants(sum.map((row, i) => row.map(entry => scaled(system.drives[i].gain, entry))), sum.map(row => row.map(() => NONE))));
}

// --- in words ---------------------------------------------------------------------------------------------------------

const LOOP_GAIN = { speed: ["K_p", 1, "N.m.s/rad"], position: ["K_v", 0.06, "(m/min)/mm"] }, LOOP_STATE = { moving: "while the axis slides", "at rest": "at rest, where friction holds it like a spring" };
const gain_words = (kind, value) => `${LOOP_GAIN[kind][0]} = ${general(value * LOOP_GAIN[kind][1], 4)} ${LOOP_GAIN[kind][2]}`;
const decibels = factor => 20 * Math.log10(factor);

// Loops that are unstable or have less than the usual margins, with the gain that would do.
function loop_warnings(loops) {
  const result = [], usual = `the usual ${decibels(JUDGED.GAIN_MARGIN).toFixed(0)} dB and ${JUDGED.PHASE_MARGIN} deg`;
  for (const name of new Set(loops.map(loop => `${loop.axis} ${loop.kind}`))) {
    const states = loops.filter(loop => `${loop.axis} ${loop.kind}` === name), { axis, kind, gain } = states[0], unstable = states.filter(loop => loop.unstable), thin = states.filter(loop => loop.thin);
    if (!unstable.length && !thin.length) continue;
    const now = gain_words(kind, gain), advised = (unstable.length ? unstable : thin).map(loop => loop.advised), better = advised.includes(null) ? `; no ${LOOP_GAIN[kind][0]} was found with which it has` : `; with ${gain_words(kind, Math.min(...advised))} it has`;
    if (!unstable.length) {
      const margins = thin.map(loop => `gain ${Number.isFinite(loop.gain_margin) ? decibels(loop.gain_margin).toFixed(1) : "inf"} dB, phase ${loop.phase_margin.toFixed(0)} deg ${LOOP_STATE[loop.state]}`).join("; ");
      result.push(`axis ${axis}: the ${kind} loop has thin margins with ${now}: ${margins}${better} ${usual}`);
    } else result.push(`axis ${axis}: the ${kind} loop is unstable with ${now}: ${states.map(limit_words).join("; ")}${better} ${usual}. The instability is physical; a smaller step does not remove it`);
  }
  return result;
}

function limit_words({ kind, state, gain, limit, unstable }) {
  const bound = limit === null ? "" : unstable ? `, stable ${limit < gain ? "below" : "above"} ${gain_words(kind, limit)}` : ` ${limit > gain ? "up" : "down"} to ${gain_words(kind, limit)}`;
  return `${unstable ? "un" : ""}stable ${LOOP_STATE[state]}${bound}`;
}

// Explicit exchange needs a friction slope well below 2 J_inf/h.
function exchange_warnings({ axes, cycles, scheme }, of, { rotor }) {
  return axes.flatMap((axis, i) => {
    const slope = of(`${axis}.friction.sigma_1`) + of(`${axis}.friction.sigma_2`), bound = scheme.stable_share * 2 / dot(rotor[i], rotor[i]) / (cycles.T_c / scheme.substeps);
    return slope > bound ? [`axis ${axis}: sigma_1 + sigma_2 = ${general(slope, 4)} N.m.s/rad is above ${general(bound, 4)}, where scheme ${scheme.name} becomes unstable at a reversal (${general(scheme.stable_share, 6)} of 2 J_inf/h); use more coupling.substeps`] : [];
  });
}

// --- how far a motion leaves the plant's pose: feedsim.structure.pose_change, feedsim.simulation.judge ----------------------

// rows: setpoints, those of the axes at every second place.
function reach_warnings({ axes, pose, limits, reach }, rows) {
  const result = [], wide = 2 * axes.length, mm = value => general(value * 1e3, 4);
  const ends = axes.map((axis, i) => {
    let low = Infinity, high = -Infinity;
    for (let k = 2 * i; k < rows.length; k += wide) { low = Math.min(low, rows[k]); high = Math.max(high, rows[k]); }
    return [low, high];
  });
  axes.forEach((axis, i) => {
    const cells = reach.grid[axis], [low, high] = ends[i], { travel } = limits[axis];
    if (!cells) return;
    const beyond = Math.max(cells[0] - Math.max(low, travel[0]), Math.min(high, travel[1]) - cells[1]);
    if (beyond > reach.near) result.push(`axis ${axis} leaves the plant's grid of poses (${general(cells[0] * 1e3, 6)} mm to ${general(cells[1] * 1e3, 6)} mm) by ${mm(beyond)} mm: the modes there are those of the last cell; pack a wider grid`);
  });
  axes.forEach((axis, i) => {
    const over = reach.over[axis], [low, high] = [Math.min(ends[i][0], pose[axis]), Math.max(ends[i][1], pose[axis])], distance = Math.max(pose[axis] - low, high - pose[axis]);
    if (!over || distance <= reach.near) return;
    const away = `axis ${axis} moves ${mm(distance)} mm away from the pose that the modes belong to`;
    if (low < over.low - 1e-4 || high > over.high + 1e-4) { result.push(`${away}: farther than this page knows of; feedsim run says how the modes have changed there`); return; }
    if (!over.position) return;
    let largest = 0, mode = 0;
    for (const end of [low, high]) if (Math.abs(end - pose[axis]) > reach.near) frequencies_at(over, Math.round(end * 1e4) / 1e4).forEach((f, k) => {
      const change = f / over.frequency[k] - 1;
      if (Math.abs(change) > Math.abs(largest)) [largest, mode] = [change, k];
    });
    if (Math.abs(largest) > reach.large) result.push(`${away}; there the mode at ${general(over.frequency[mode], 4)} Hz (${over.moving[mode]}) has changed its frequency by ${largest > 0 ? "+" : ""}${general(100 * largest, 2)} %; for a plant that follows: feedsim export --plant ... --poses ${axis}=20mm`);
  });
  return result;
}

// Cubics through the four nearest positions.
function frequencies_at({ position, there }, at) {
  const n = position.length;
  let first = position.findIndex(entry => entry > at);
  first = Math.min(Math.max((first < 0 ? n : first) - 2, 0), Math.max(n - 4, 0));
  const near = position.slice(first, first + 4), weights = near.map((x, i) => near.reduce((weight, other, j) => i === j ? weight : weight * (at - other) / (x - other), 1));
  return there[0].map((_, mode) => weights.reduce((sum, weight, i) => sum + weight * there[first + i][mode], 0));
}
