// Drives and structure as one linear sampled system: feedsim.linear (drive.py, plant.py, system.py) once more, one value of s at a
// time. Definitions and sources stand there; a test holds both to the same digits. Complex numbers are pairs [re, im].
const ONE = [1, 0], NONE = [0, 0];
const plus = (a, b) => [a[0] + b[0], a[1] + b[1]], less = (a, b) => [a[0] - b[0], a[1] - b[1]], scaled = (k, a) => [k * a[0], k * a[1]];
const mul = (a, b) => [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]], size_of = a => Math.sqrt(a[0] * a[0] + a[1] * a[1]), angle_of = a => Math.atan2(a[1], a[0]);
const over = (a, b) => { const n = b[0] * b[0] + b[1] * b[1]; return [(a[0] * b[0] + a[1] * b[1]) / n, (a[1] * b[0] - a[0] * b[1]) / n]; };
const exponential = a => { const size = Math.exp(a[0]); return [size * Math.cos(a[1]), size * Math.sin(a[1])]; };
const exponential_less_1 = a => [Math.expm1(a[0]) * Math.cos(a[1]) - 2 * Math.sin(a[1] / 2) ** 2, Math.exp(a[0]) * Math.sin(a[1])];

// Solutions of matrix X = right, square complex matrices of rows; also the determinant, right null for that alone.
function solved(matrix, right) {
  const n = matrix.length, A = matrix.map((row, i) => right ? [...row, ...right[i]] : [...row]), wide = A[0].length;
  let determinant = ONE;
  for (let k = 0; k < n; k++) {
    let best = k;
    for (let i = k + 1; i < n; i++) if (size_of(A[i][k]) > size_of(A[best][k])) best = i;
    if (best !== k) { [A[k], A[best]] = [A[best], A[k]]; determinant = scaled(-1, determinant); }
    determinant = mul(determinant, A[k][k]);
    for (let i = right ? 0 : k + 1; i < n; i++) {
      if (i === k) continue;
      const f = over(A[i][k], A[k][k]);
      for (let j = k + 1; j < wide; j++) A[i][j] = less(A[i][j], mul(f, A[k][j]));
    }
  }
  return { determinant, x: right && A.map((row, i) => row.slice(n).map(entry => over(entry, row[i]))) };
}
const matrix_product = (A, B) => A.map(row => B[0].map((_, j) => row.reduce((sum, entry, k) => plus(sum, mul(entry, B[k][j])), NONE)));
const with_one = A => A.map((row, i) => row.map((entry, j) => i === j ? plus(ONE, entry) : entry));

// --- the drive of an axis ---------------------------------------------------------------------------------------------

// of(name): value of a parameter of the drive; a drive about standstill.
function linear_drive(of, { T_c, T_pos }, I_P) {
  const ticks = Math.round(T_pos / T_c), indirect = Boolean(of("measuring.indirect")), window = (of("speed_window") || 0) * T_c, filters = [1, 2, 3, 4].filter(i => of(`filter_${i}.type`)).map(i => {
    const omega = 2 * Math.PI * of(`filter_${i}.f`), low_pass = of(`filter_${i}.type`) === 2;
    return { below: [1, 2 * of(`filter_${i}.D_den`) * omega, omega ** 2], above: low_pass ? [0, 0, omega ** 2] : [1, 2 * of(`filter_${i}.D_num`) * omega, omega ** 2], factor: omega / Math.tan(omega * T_c / 2) };
  });
  const integrator = s => of("speed_integrator") ? over([of("K_p") * T_c / of("T_n"), 0], scaled(-1, exponential_less_1(scaled(-T_c, s)))) : NONE;
  const reference = s => {
    if (!of("reference_model")) return ONE;
    const omega = of("omega_0");
    return mul(bilinear(s, [0, 0, omega ** 2], [1, 2 * of("D") * omega, omega ** 2], 2 / T_c, T_c), linear_delay(s, of("T_ref") / T_c, T_c));
  };
  return {
    ticks, indirect, K_p: of("K_p"), K_v: of("K_v"), ideal: Boolean(of("ideal_current_loop")), gain: of("K_v") / I_P,
    setpoint_delay: s => of("symmetry_lag") ? mul(cubic_delay(s, of("T_dyn") / T_pos, T_pos), lag(s, of("T_sym"), T_pos)) : cubic_delay(s, (of("T_dyn") + of("T_sym")) / T_pos, T_pos),
    feedforward: s => scaled(of("k_ffw"), cubic_delay(s, of("T_dyn") / T_pos, T_pos)),
    ramp(s) {
      const last = exponential(scaled(-T_pos, s)), step = exponential(scaled(-T_c, s));
      let sum = NONE, tick = ONE;
      for (let j = 0; j < ticks; j++) {
        const share = of("ramp_speed_setpoint") ? (j + 1) / ticks : 1;
        sum = plus(sum, mul(tick, plus([share, 0], scaled(1 - share, last))));
        tick = mul(tick, step);
      }
      return scaled(1 / ticks, sum);
    },
    // Measured positions, of those of a row of speeds and one of positions.
    measured: (s, n, x) => indirect ? (turned => n.map(entry => mul(turned, entry)))(scaled(0.5 * T_c * I_P, over(plus(exponential(scaled(T_c, s)), ONE), exponential_less_1(scaled(T_c, s))))) : x,
    speed_of_position: s => window ? scaled(-1 / (window * I_P), exponential_less_1(scaled(-window, s))) : null,
    from_speed: s => plus([of("K_p"), 0], integrator(s)),
    from_setpoint: s => plus([of("K_p"), 0], mul(integrator(s), reference(s))),
    // E and G_n with M_a = E M_s - G_n n_a.
    torque(s) {
      const filtered = filters.reduce((result, { above, below, factor }) => mul(result, bilinear(s, above, below, factor, T_c)), ONE);
      if (of("ideal_current_loop")) return [filtered, NONE];
      // At standstill the torque-forming current is alone: of the motor's equations its row is left.
      const R = of("R"), L_q = of("L_q"), K_t = of("K_t"), Phi = Math.exp(-R * T_c / L_q), per_voltage = R ? -Math.expm1(-R * T_c / L_q) / R : T_c / L_q, z = exponential(scaled(T_c, s)), late = scaled(-1, exponential_less_1(scaled(-T_c, s)));
      const K = plus([of("current.K_p"), 0], over([of("current.K_p") * T_c / of("current.T_n"), 0], late)), controlled = over(scaled(per_voltage, K), z), below = plus(less(z, [Phi, 0]), controlled);
      return [mul(filtered, over(controlled, below)), over(scaled(K_t * per_voltage * K_t / 1.5, late), below)];
    },
  };
}

function bilinear(s, above, below, factor, T) {
  const difference = scaled(factor, exponential_less_1(scaled(T, s))), total = plus(exponential(scaled(T, s)), ONE), terms = [mul(difference, difference), mul(difference, total), mul(total, total)];
  const sum = weights => terms.reduce((result, entry, k) => plus(result, scaled(weights[k], entry)), NONE);
  return over(sum(above), sum(below));
}

// A delay of `samples` cycles of T: Lagrange through four ages about it.
function cubic_delay(s, samples, T) {
  const nearest = half_even(samples);
  if (Math.abs(samples - nearest) < 1e-9 * Math.max(1, nearest)) return exponential(scaled(-nearest * T, s));
  const first = Math.max(Math.floor(samples) - 1, 0), ages = [0, 1, 2, 3].map(k => first + k);
  return ages.reduce((sum, age) => plus(sum, scaled(ages.reduce((weight, other) => other === age ? weight : weight * (samples - other) / (age - other), 1), exponential(scaled(-age * T, s)))), NONE);
}

function linear_delay(s, samples, T) {
  const whole = Math.floor(samples + 1e-9), rest = Math.max(samples - whole, 0);
  return mul(exponential(scaled(-whole * T, s)), plus([1 - rest, 0], scaled(rest, exponential(scaled(-T, s)))));
}

function lag(s, time_constant, T) {
  if (!time_constant) return ONE;
  const a = Math.exp(-T / time_constant), slow = (1 - a) * time_constant / T, back = exponential(scaled(-T, s));
  return over(plus([1 - slow, 0], scaled(slow - a, back)), plus(ONE, scaled(-a, back)));
}

// --- the structure ----------------------------------------------------------------------------------------------------

// table: {omega_0, damping, rotor, scale}, the latter of every axis; speeds and positions of the axes per torque at s.
class ModalPlant {
  constructor(table, T) {
    this.table = table;
    this.T = T;
    this.A = table.rotor.length;
    this.parts = { linear: this.kinds("linear"), held: this.kinds("held") };
  }

  // Of every mode its pairs of poles, with weights: near critical damping ratios above and below it stand for it.
  kinds(hold) {
    const result = [];
    this.table.omega_0.forEach((omega, mode) => {
      const zeta = this.table.damping[mode];
      if (omega === 0) result.push({ mode, rigid: true });
      else for (const [weight, away] of Math.abs(zeta - 1) < 1e-4 ? [[2 / 3, 2e-4], [2 / 3, -2e-4], [-1 / 6, 4e-4], [-1 / 6, -4e-4]] : [[1, 0]]) result.push({ mode, weight, ...this.poles(omega, zeta + away, hold) });
    });
    return result;
  }

  poles(omega, zeta, hold) {
    const { T } = this, root = zeta >= 1 ? [Math.sqrt(zeta * zeta - 1), 0] : [0, Math.sqrt(1 - zeta * zeta)], first = scaled(omega, plus([-zeta, 0], root)), second = scaled(omega, less([-zeta, 0], root));
    const numbers = p => {
      const x = scaled(T, p), grown = exponential_less_1(x), phi_1 = over(grown, x);
      if (hold === "held") return { pole: p, exp: exponential(x), slope: NONE, level: scaled(T, phi_1) };
      let phi_2 = NONE;
      if (size_of(x) < 0.5) for (let k = 17, terms = 355687428096000; k > 1; terms /= k, k--) phi_2 = plus(mul(phi_2, x), [1 / terms, 0]);
      else phi_2 = over(less(grown, x), mul(x, x));
      return { pole: p, exp: exponential(x), slope: scaled(T, phi_2), level: scaled(T, less(phi_1, phi_2)) };
    };
    return { one: numbers(first), two: numbers(second), apart: over(ONE, less(first, second)) };
  }

  // {n, x}: matrices of rows, speeds and positions of the axes per torque that runs by `hold`.
  at(s, hold) {
    const { A, T, table: { rotor, scale } } = this, n_re = new Float64Array(A * A), n_im = new Float64Array(A * A), x_re = new Float64Array(A * A), x_im = new Float64Array(A * A);
    const z = exponential(scaled(T, s)), [z_re, z_im] = z, grown = exponential_less_1(scaled(T, s));
    let rigid = null;
    for (const part of this.parts[hold]) {
      let q_re, q_im, v_re, v_im;
      if (part.rigid) {
        rigid ||= hold === "linear" ? [scaled(T * T / 6, over(plus(plus(mul(z, z), scaled(4, z)), ONE), mul(grown, grown))), scaled(T / 2, over(plus(z, ONE), grown))]
          : [scaled(T * T / 2, over(plus(z, ONE), mul(grown, grown))), over([T, 0], grown)];
        [[q_re, q_im], [v_re, v_im]] = rigid;
      } else {
        const { one, two, apart, weight } = part;
        // h(p) = (level + slope z)/(z - exp(p T)), without a pair for each step: this is where the time goes
        let a = one.level[0] + one.slope[0] * z_re - one.slope[1] * z_im, b = one.level[1] + one.slope[0] * z_im + one.slope[1] * z_re, c = z_re - one.exp[0], d = z_im - one.exp[1], size = c * c + d * d;
        const h_re = (a * c + b * d) / size, h_im = (b * c - a * d) / size;
        a = two.level[0] + two.slope[0] * z_re - two.slope[1] * z_im; b = two.level[1] + two.slope[0] * z_im + two.slope[1] * z_re; c = z_re - two.exp[0]; d = z_im - two.exp[1]; size = c * c + d * d;
        const g_re = (a * c + b * d) / size, g_im = (b * c - a * d) / size, u_re = h_re - g_re, u_im = h_im - g_im;
        const w_re = one.pole[0] * h_re - one.pole[1] * h_im - two.pole[0] * g_re + two.pole[1] * g_im, w_im = one.pole[0] * h_im + one.pole[1] * h_re - two.pole[0] * g_im - two.pole[1] * g_re;
        q_re = weight * (u_re * apart[0] - u_im * apart[1]); q_im = weight * (u_re * apart[1] + u_im * apart[0]);
        v_re = weight * (w_re * apart[0] - w_im * apart[1]); v_im = weight * (w_re * apart[1] + w_im * apart[0]);
      }
      for (let i = 0, at = 0; i < A; i++) {
        const turned = rotor[i][part.mode], moved = scale[i][part.mode];
        for (let j = 0; j < A; j++, at++) {
          const into = rotor[j][part.mode], n = turned * into, x = moved * into;
          n_re[at] += n * v_re; n_im[at] += n * v_im; x_re[at] += x * q_re; x_im[at] += x * q_im;
        }
      }
    }
    const rows = (re, im) => Array.from({ length: A }, (_, i) => Array.from({ length: A }, (__, j) => [re[i * A + j], im[i * A + j]]));
    return { n: rows(n_re, n_im), x: rows(x_re, x_im) };
  }
}

// --- both together ----------------------------------------------------------------------------------------------------

// A state of the machine. machine: of the page; of(name): value of a parameter of the unit; table: its modes.
class LinearSystem {
  constructor(machine, of, plant) {
    this.machine = machine;
    this.axes = machine.axes;
    this.plant = plant;
    this.drives = machine.axes.map(axis => linear_drive(name => of(`${axis}.drive.${name}`), machine.cycles, machine.I_P[axis]));
    this.ideal = this.drives.map(drive => drive.ideal);
    this.bristles = machine.axes.map(axis => {
      const friction = name => of(`${axis}.friction.${name}`), k = friction("W") > 0 ? 0.5 * (1 + friction("gamma")) : 1;
      return { stiffness: k * friction("sigma_0"), damping: friction("sigma_1") + friction("sigma_2") };
    });
  }

  // Speeds and positions per torque of the motors (each running as its drive has it), and per torque of friction.
  ports(s) {
    const linear = this.plant.at(s, "linear");
    if (!this.ideal.some(entry => entry)) return { motor: linear, friction: linear };
    const held = this.plant.at(s, "held"), mixed = name => linear[name].map((row, i) => row.map((entry, j) => this.ideal[j] ? held[name][i][j] : entry));
    return { motor: { n: mixed("n"), x: mixed("x") }, friction: linear };
  }

  // What the speed loops take off the torques per torque, of speeds n and positions x per torque.
  torque_loop(s, torques, n, x) {
    const measured = this.drives.map((drive, i) => drive.measured(s, n[i], x[i]));
    const loop = this.drives.map((drive, i) => {
      const [E, G_n] = torques[i], C = mul(E, drive.from_speed(s)), V = drive.speed_of_position(s);
      return n[i].map((entry, j) => plus(mul(C, V ? mul(V, measured[i][j]) : entry), mul(G_n, entry)));
    });
    return { loop, measured };
  }

  // Of the closed position loops at a frequency what all axes' responses share: positions per answer of the position
  // controllers, and positions and their measured values per torque at the motor but for the current loop.
  position_loops(frequency) {
    const { cycles: { T_pos } } = this.machine, m = this.drives[0].ticks, s = [0, 2 * Math.PI * frequency];
    let slow = this.axes.map(() => this.axes.map(() => NONE)), fast = null, ramps = null, pushed = null;
    for (let k = 0; k < m; k++) {
      const at = [0, s[1] + 2 * Math.PI * k / T_pos], { motor: { n, x } } = this.ports(at), torques = this.drives.map(drive => drive.torque(at)), { loop, measured } = this.torque_loop(at, torques, n, x);
      const given = this.drives.map((drive, i) => this.axes.map((_, j) => i === j ? mul(torques[i][0], drive.from_setpoint(at)) : NONE)), M = solved(with_one(loop), given).x, ramp = this.drives.map(drive => drive.ramp(at));
      slow = matrix_product(measured, M).map((row, i) => row.map((entry, j) => plus(slow[i][j], mul(entry, ramp[j]))));
      if (k === 0) {
        const torque = solved(with_one(loop), this.axes.map((_, i) => this.axes.map((__, j) => i === j ? torques[i][0] : NONE))).x;
        fast = matrix_product(x, M);
        ramps = ramp;
        pushed = { x: matrix_product(x, torque), measured: matrix_product(measured, torque) };
      }
    }
    return { s, fast, ramps, pushed, controlled: with_one(slow.map((row, i) => row.map(entry => scaled(this.drives[i].gain, entry)))) };
  }

  // The position of an axis as the position controllers answer.
  answering({ fast, ramps, controlled }, own, answer) {
    const answers = solved(controlled, answer.map(entry => [entry])).x;
    return answers.reduce((sum, entry, j) => plus(sum, mul(fast[own][j], mul(ramps[j], entry[0]))), NONE);
  }

  // x_a over x_s, n_ffw being the setpoint's derivative over the lead.
  position_reference(axis, loops) {
    const own = this.axes.indexOf(axis), { s } = loops;
    return this.answering(loops, own, this.drives.map((drive, i) => i === own ? plus(scaled(drive.gain, drive.setpoint_delay(s)), mul(scaled(1 / this.machine.I_P[axis], s), drive.feedforward(s))) : NONE));
  }

  // How an axis follows an error of its measured position, -x_a over it; of a motor encoder the speed errs, too.
  following(axis, loops) {
    const own = this.axes.indexOf(axis), drive = this.drives[own], { s } = loops, position = this.answering(loops, own, this.drives.map((_, i) => i === own ? [drive.gain, 0] : NONE));
    return drive.indirect ? plus(position, mul(this.drag(axis, loops), mul(drive.from_speed(s), scaled(1 / this.machine.I_P[axis], s)))) : position;
  }

  // x_a over M_add, a torque at the motor but for the current loop [m/(N.m)].
  drag(axis, loops) {
    const own = this.axes.indexOf(axis), { pushed } = loops;
    return plus(pushed.x[own][own], this.answering(loops, own, this.drives.map((drive, i) => scaled(-drive.gain, pushed.measured[i][own]))));
  }
}

// Mode shapes at the ports of the axes, from the table of modes (docs/scenarios.md).
function mode_table(text, axes) {
  const [head, ...rows] = text.trim().split(/\r?\n/).map(line => line.split(",")), column = name => { const k = head.indexOf(name); return Float64Array.from(rows, row => Number(row[k])); };
  return { omega_0: column("frequency [Hz]").map(f => 2 * Math.PI * f), damping: column("damping ratio [1]"), rotor: axes.map(axis => column(`n_${axis}`)), scale: axes.map(axis => column(`x_${axis}`)) };
}
