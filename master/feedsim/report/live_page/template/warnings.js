// What a run warns of, but for its control loops: feedsim.simulation.judge once more, in the same words.

// As Python writes "{value:.{digits}g}".
function general(value, digits) {
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e"), at = Number(exponent);
  const trimmed = text => text.includes(".") ? text.replace(/\.?0+$/, "") : text;
  if (at < -4 || at >= digits) return `${trimmed(mantissa)}e${at < 0 ? "-" : "+"}${String(Math.abs(at)).padStart(2, "0")}`;
  return trimmed(value.toFixed(Math.max(digits - 1 - at, 0)));
}

// What a run's own limits tell a reader to doubt, in the words of feedsim run (feedsim.simulation.judge).
function limit_warnings(machine, trace) {
  const result = [], percent = value => general(value, 2);
  for (const axis of machine.axes) for (const limit of machine.flags) {
    const flags = trace[`${axis}.${limit}`], share = flags.reduce((sum, entry) => sum + (entry ? 1 : 0), 0) / flags.length;
    if (share > 0) result.push(`axis ${axis}: ${limit.replace("_", " ")} in ${percent(100 * share)} % of the recorded instants`);
  }
  return result;
}

// Explicit exchange needs a friction slope well below 2 J_inf/h; bounds: of that of every axis.
function exchange_warnings({ axes, scheme }, of) {
  return axes.flatMap(axis => {
    const slope = of(`${axis}.friction.sigma_1`) + of(`${axis}.friction.sigma_2`), bound = scheme.bounds[axis];
    return slope > bound ? [`axis ${axis}: sigma_1 + sigma_2 = ${general(slope, 4)} N.m.s/rad is above ${general(bound, 4)}, where scheme ${scheme.name} becomes unstable at a reversal (${general(scheme.stable_share, 6)} of 2 J_inf/h); use more coupling.substeps`] : [];
  });
}

// How far a motion leaves the plant's pose: feedsim.structure.pose_change.

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
