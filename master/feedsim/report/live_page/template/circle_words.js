// What a diagnosis says: feedsim.analysis.circle.words once more, in the same words.
const SAID = { LITTLE: 0.05, NOISY: 0.3, BESIDES: 0.25, CERTAINTY: 2 };

// As Python writes "{value:.{digits}g}".
function general(value, digits) {
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e"), at = Number(exponent);
  const trimmed = text => text.includes(".") ? text.replace(/\.?0+$/, "") : text;
  if (at < -4 || at >= digits) return `${trimmed(mantissa)}e${at < 0 ? "-" : "+"}${String(Math.abs(at)).padStart(2, "0")}`;
  return trimmed(value.toFixed(Math.max(digits - 1 - at, 0)));
}

// Three digits that matter, or two, and none after the third place behind the point.
const three = value => value.toFixed(Math.min(Math.max(0, 2 - Number(value.toExponential(2).split("e")[1])), 3));
const two = value => value.toFixed(Math.min(Math.max(0, 1 - Number(value.toExponential(1).split("e")[1])), 3));
const in_um = value => `${two(value * 1e6)} um`;
const term_of = (diagnosis, key) => diagnosis.terms.find(term => term.key === key);

function named_terms({ terms, G }) {
  const able = terms.filter(term => term.certain && term.key !== "rest" && term.key !== "radius" && (term.gain > 0 || !(Math.abs(term.value) < SAID.CERTAINTY * term.half))), result = able.filter(term => term.share >= SAID.LITTLE && term.size >= SAID.LITTLE * G);
  const besides = able.filter(term => !result.includes(term) && term.key !== "offset" && term.size >= SAID.BESIDES * G);
  return [...result.sort((a, b) => b.gain - a.gain || b.share - a.share), ...besides.sort((a, b) => b.size - a.size)];
}

// Why the circle is not round: quantity and value, the main cause with its size, the remedy.
function answer_of(diagnosis) {
  const named = named_terms(diagnosis), G = `G = ${in_um(diagnosis.G)}`, rest = term_of(diagnosis, "rest");
  if (!named.length) return `${G}. No single cause stands out; ${in_um(rest.size)} remain unexplained.`;
  const [what, remedy] = described(diagnosis, named[0]), said = [G, `${named[0].share > 0.5 ? "Main" : "Largest"} cause: ${what}`, ...(remedy ? [`Remedy: ${remedy}`] : []), ...named.slice(1, 3).map(term => `Also: ${described(diagnosis, term)[0]}`)];
  const trust = diagnosis.noise > SAID.NOISY * diagnosis.G ? ` Noise of ${in_um(diagnosis.noise)} hides much: measure again, or more slowly.`
    : Math.max(Math.abs(rest.share), rest.size / diagnosis.G) > 0.5 ? " The model explains less than half of G: look at the picture before acting on it." : "";
  return `${said.join(". ")}.${trust}`;
}

function sentence_of(diagnosis, term) {
  const [what, remedy] = described(diagnosis, term);
  return remedy ? `${what}; remedy: ${remedy}` : what;
}

// A cause with its amount, and the remedy.
function described(diagnosis, term) {
  const [first, second] = diagnosis.circle.axes, { value, axis } = term, amount = Math.abs(value);
  if (!term.certain && term.key !== "rest" && term.key !== "peaks") return [`${name_of(term)}: cannot be distinguished from zero`, ""];
  switch (term.key) {
    case "offset": return [`the centre lies ${in_um(amount)} off`, "set up the measurement again, or look for drift"];
    case "radius": return [`the radius is ${in_um(amount)} too ${value > 0 ? "large" : "small"}: ${lag_words(diagnosis, value)}`, ""];
    case "scale": {
      const [more, less] = value > 0 ? [first, second] : [second, first];
      return [`${more} travels ${three(amount * 1e6)} um/m more than ${less}: ${unlike_words(diagnosis, value)}`, ""];
    }
    case "squareness": return [`squareness: the angle between ${first}+ and ${second}+ is ${two(amount * 1e6)} um/m ${value > 0 ? "less" : "more"} than 90 deg`, "align the guideways, or change their squareness compensation"];
    case "servo": {
      const [late, early] = value > 0 ? [first, second] : [second, first], time = `${two(amount * 1e3)} ms`;
      return [`servo mismatch: ${late} lags ${early} by ${time}`, `raise K_v or feedforward of ${late}, or delay ${early} by ${time} (T_dyn)`];
    }
    case "squareness_or_servo": {
      const delay = 2 * amount / diagnosis.circle.speed * 1e3, [late, early] = diagnosis.senses[0] * value > 0 ? [first, second] : [second, first];
      return [`an ellipse along ${value > 0 ? "+" : "-"}45 deg of ${in_um(amount)} amplitude: servo mismatch (${late} lags ${early} by ${two(delay)} ms) or squareness `
        + `(${three(2 * amount / diagnosis.circle.radius * 1e6)} um/m)`, "record the other direction; it separates the two"];
    }
    case "lost_motion": return value > 0 ? [`lost motion of ${axis} (${in_um(amount)}), caused by backlash or wind-up`, "backlash compensation"]
      : [`${axis} gains ${in_um(amount)} where it reverses, caused by too much backlash compensation, or friction at rest`, "less backlash compensation"];
    case "peaks": return peak_words(diagnosis, term);
    case "pitch": return [`pitch error of ${axis} (${in_um(amount)} amplitude)`, "check screw and motor encoder, or compensate the pitch"];
  }
  return [`what no cause explains: ${in_um(term.size)} from peak to valley (${diagnosis.form.map(([n, size]) => `order ${n}: ${in_um(size)}`).join(", ")})`, ""];
}

function unlike_words({ unlike }, value) {
  if (unlike === null) return "scale, temperature or pitch compensation, or an unlike decrease of the amplitude by path lag";
  const response = Math.sign(value) * unlike;
  return `the response of the axes makes ${three(response * 1e6)} um/m (K_v, speed feedforward, compliance behind a motor encoder), scale, temperature or pitch compensation ${three((Math.abs(value) - response) * 1e6)} um/m`;
}

function lag_words({ lag }, change) {
  if (lag === null) return "path lag without speed feedforward, symmetry filter T_sym, or a scale of both axes; one feed cannot tell which: path lag grows with the square of the feed, a scale does not";
  return `path lag makes ${three(lag * 1e6)} um by the response of the position loops (K_v, speed feedforward, T_sym), friction or a scale ${three(1e6 * (change - lag))} um`;
}

function peak_words({ peaks }, { axis }) {
  const largest = largest_peak(peaks, axis), { height } = largest;
  if (height === 0) {
    const seen = peaks.filter(peak => peak.axis === axis && Number.isFinite(peak.half)).map(peak => peak.half), limit = seen.length ? Math.max(...seen) : NaN;
    return [`where ${axis} reverses nothing stands out${limit > 1e-8 ? ` (above ${in_um(limit)})` : ""}`, ""];
  }
  const wide = Number.isFinite(largest.width) ? `, ${two(largest.width * 1e3)} ms wide` : "";
  return height > 0 ? [`reversal peaks of ${axis} (${in_um(height)} high${wide}), caused by friction`, "friction compensation"]
    : [`reversal peaks of ${axis} (${in_um(-height)} ahead${wide}), caused by too much friction compensation`, "less of it"];
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
    result.push(`glitch_${axis}, ${general(old, 4)} ${unit}, is the largest deviation of the quadrant, most of it ${name_of(form)}; the reversal peak of ${axis} itself is ${general(height * 1e6, 3)} um`);
  }
  return result;
}

// Cells of a cause: name, amount to the digits that its interval leaves it, what it makes alone, share of G, what it means.
function cause_row(diagnosis, term) {
  const [factor, unit] = CAUSE_UNITS[term.unit], value = factor * term.value, half = factor * term.half, places = Number.isFinite(half) && half > 0 ? Math.max(0, 1 - Math.floor(Math.log10(half))) : -1, name = name_of(term);
  const amount = places < 0 ? typeset(with_minus(general(value, 3))) : `${with_minus(value.toFixed(places))} ± ${half.toFixed(places)}`;
  return [name[0].toUpperCase() + name.slice(1), `${amount} ${typeset(unit)}`, with_minus((1e6 * term.size).toFixed(2)), with_minus((100 * term.share).toFixed(1)), typeset(sentence_of(diagnosis, term))];
}
