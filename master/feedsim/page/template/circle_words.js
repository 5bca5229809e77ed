// What a diagnosis says: feedsim.analysis.circle.words once more, in the same words.
const SAID = { LITTLE: 0.05, NOISY: 0.3, BESIDES: 0.25, CERTAINTY: 2 };

// As Python writes "{value:.{digits}g}".
function general(value, digits) {
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e"), at = Number(exponent);
  const trimmed = text => text.includes(".") ? text.replace(/\.?0+$/, "") : text;
  if (at < -4 || at >= digits) return `${trimmed(mantissa)}e${at < 0 ? "-" : "+"}${String(Math.abs(at)).padStart(2, "0")}`;
  return trimmed(value.toFixed(Math.max(digits - 1 - at, 0)));
}

// Three digits that matter, and none after the third place behind the point.
const three = value => value.toFixed(Math.min(Math.max(0, 2 - Number(value.toExponential(2).split("e")[1])), 3));
const in_um = value => `${three(value * 1e6)} um`;
const term_of = (diagnosis, key) => diagnosis.terms.find(term => term.key === key);

function named_terms({ terms, G }) {
  const able = terms.filter(term => term.certain && term.key !== "rest" && term.key !== "radius" && (term.gain > 0 || !(Math.abs(term.value) < SAID.CERTAINTY * term.half))), result = able.filter(term => term.share >= SAID.LITTLE && term.size >= SAID.LITTLE * G);
  const besides = able.filter(term => !result.includes(term) && term.key !== "offset" && term.size >= SAID.BESIDES * G);
  return [...result.sort((a, b) => b.gain - a.gain || b.share - a.share), ...besides.sort((a, b) => b.size - a.size)];
}

// Why the circle is not round, in a sentence or two.
function answer_of(diagnosis) {
  const named = named_terms(diagnosis), G = `circular deviation G ${in_um(diagnosis.G)}`, rest = term_of(diagnosis, "rest");
  if (!named.length) return `${G}: no single cause stands out; what remains is ${in_um(rest.size)}.`;
  const said = [`${G}, ${named[0].share > 0.5 ? "mostly: " : "first: "}${sentence_of(diagnosis, named[0])}`, ...named.slice(1, 3).map(term => `Then ${sentence_of(diagnosis, term)}`)];
  const trust = diagnosis.noise > SAID.NOISY * diagnosis.G ? ` Noise of ${in_um(diagnosis.noise)} hides much: measure again, or more slowly.`
    : Math.max(Math.abs(rest.share), rest.size / diagnosis.G) > 0.5 ? " The model explains less than half of G: look at the picture before acting on it." : "";
  return `${said.join(". ")}.${trust}`;
}

function sentence_of(diagnosis, term) {
  const [first, second] = diagnosis.circle.axes, { value, axis } = term, amount = Math.abs(value);
  if (!term.certain && term.key !== "rest" && term.key !== "peaks") return `${name_of(term)}: cannot be distinguished from zero`;
  switch (term.key) {
    case "offset": return `the centre lies ${in_um(amount)} off: set-up of the measurement, or drift since the centre was set`;
    case "radius": return `the radius is ${in_um(amount)} too ${value > 0 ? "large" : "small"}: ${lag_words(diagnosis, value)}`;
    case "scale": {
      const [more, less] = value > 0 ? [first, second] : [second, first];
      return `${more} travels ${three(amount * 1e6)} um/m more than ${less}: ${unlike_words(diagnosis, value)}`;
    }
    case "squareness": return `the angle between ${first}+ and ${second}+ is ${three(amount * 1e6)} um/m ${value > 0 ? "less" : "more"} than 90 deg: squareness of the guideways, or its compensation`;
    case "servo": {
      const [late, early] = value > 0 ? [first, second] : [second, first];
      return `${late} answers ${three(amount * 1e3)} ms later than ${early}: K_v, speed feedforward or T_dyn`;
    }
    case "squareness_or_servo": {
      const delay = 2 * amount / diagnosis.circle.speed * 1e3, [late, early] = diagnosis.senses[0] * value > 0 ? [first, second] : [second, first];
      return `an ellipse along ${value > 0 ? "+" : "-"}45 deg of ${in_um(amount)} amplitude: servo mismatch (${late} answers ${three(delay)} ms later than ${early}) or squareness `
        + `(${three(2 * amount / diagnosis.circle.radius * 1e6)} um/m); one direction cannot tell which, the other one will`;
    }
    case "lost_motion": return `${axis} ${value > 0 ? "loses" : "gains"} ${in_um(amount)} where it reverses: ${value > 0 ? "backlash or wind-up, which backlash compensation takes away" : "too much backlash compensation, or friction at rest"}`;
    case "peaks": return peak_words(diagnosis, term);
    case "pitch": return `${axis} errs by ${in_um(amount)} (amplitude) with every pitch of its drive: screw, or motor encoder`;
  }
  return `what no cause explains: ${in_um(term.size)} from peak to valley (${diagnosis.form.map(([n, size]) => `order ${n}: ${in_um(size)}`).join(", ")})`;
}

function unlike_words({ unlike }, value) {
  if (unlike === null) return "scale, temperature or pitch compensation, or an unlike decrease of the amplitude by path lag";
  const response = Math.sign(value) * unlike;
  return `the response of the axes makes ${three(response * 1e6)} um/m (K_v, speed feedforward, compliance behind a motor encoder), scale, temperature or pitch compensation ${three((Math.abs(value) - response) * 1e6)} um/m`;
}

function lag_words({ lag }, change) {
  if (lag === null) return "path lag without speed feedforward, symmetry filter T_sym, or a scale of both axes; one feed cannot tell which: path lag grows with the square of the feed, a scale does not";
  return `path lag makes ${in_um(lag)} by the response of the position loops (K_v, speed feedforward, T_sym), friction or a scale ${in_um(change - lag)}`;
}

function peak_words({ peaks }, { axis }) {
  const largest = largest_peak(peaks, axis);
  if (largest.height === 0) {
    const seen = peaks.filter(peak => peak.axis === axis && Number.isFinite(peak.half)).map(peak => peak.half), limit = seen.length ? Math.max(...seen) : NaN;
    return `where ${axis} reverses nothing stands out${limit > 1e-8 ? ` (above ${in_um(limit)})` : ""}`;
  }
  const behind = largest.height > 0, wide = Number.isFinite(largest.width) ? `, ${general(largest.width * 1e3, 3)} ms wide` : "";
  return `${axis} ${behind ? "stays behind" : "jumps ahead"} for a moment where it reverses, ${in_um(Math.abs(largest.height))}${wide}: ${behind ? "friction, which friction compensation takes away" : "too much friction compensation"}`;
}

function swinging_words({ vibrations }) {
  return vibrations.length ? `Between the reversals swings ${vibrations.map(entry => `${entry.axis} ${in_um(entry.amplitude)} (amplitude) at ${general(entry.frequency, 3)} Hz`).join(", ")}.` : "";
}

function name_of(term) {
  return { offset: "centre offset", radius: "mean radius", scale: "scale mismatch", squareness: "squareness", servo: "servo mismatch", squareness_or_servo: "squareness or servo mismatch",
    lost_motion: `lost motion of ${term.axis}`, pitch: `pitch error of ${term.axis}`, peaks: `reversal peaks of ${term.axis}`, rest: "rest" }[term.key];
}

// Figures whose names promise something else, of one circle: feedsim.analysis.circle_figures.misleading.
function misleading(diagnosis, figures) {
  const result = [];
  for (const axis of diagnosis.circle.axes) {
    const { height } = largest_peak(diagnosis.peaks, axis), [old, unit] = figures[`glitch_${axis}`], off = Math.abs(old * 1e-6 - height);
    if (!(off > Math.max(0.2 * Math.abs(height), 1e-6))) continue;
    const form = diagnosis.terms.filter(term => term.key !== "peaks" && term.key !== "rest").reduce((best, term) => term.size > best.size ? term : best);
    result.push(`glitch_${axis}, ${general(old, 4)} ${unit}, is the largest deviation in the quadrant whatever its cause; what stands out where ${axis} reverses is peak_${axis}, ${general(height * 1e6, 3)} um. The rest is form, most of it ${name_of(form)}`);
  }
  return result;
}

// Cells of a cause: name, amount to the digits that its interval leaves it, what it makes alone, share of G, what it means.
function cause_row(diagnosis, term) {
  const [factor, unit] = CAUSE_UNITS[term.unit], value = factor * term.value, half = factor * term.half, places = Number.isFinite(half) && half > 0 ? Math.max(0, 1 - Math.floor(Math.log10(half))) : -1, name = name_of(term);
  const amount = places < 0 ? typeset(with_minus(general(value, 3))) : `${with_minus(value.toFixed(places))} ± ${half.toFixed(places)}`;
  return [name[0].toUpperCase() + name.slice(1), `${amount} ${typeset(unit)}`, with_minus((1e6 * term.size).toFixed(2)), with_minus((100 * term.share).toFixed(1)), typeset(sentence_of(diagnosis, term))];
}
