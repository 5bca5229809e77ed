// Words with the signs of print: feedsim.report.formatting once more.
const with_minus = text => text.replace(/^-(?=0(\.0*)?$)/, "").replaceAll("-", "−");
const raised = (text, digits = "⁰¹²³⁴⁵⁶⁷⁸⁹") => [...text].map(entry => entry === "-" ? "⁻" : digits[entry]).join("");

function typeset(text) {
  return text.replace(/\bum\b/g, "µm").replace(/\bN\.m\b(\.s\b)?/g, entry => entry.replaceAll(".", "·")).replace(/(?<=\d) deg\b/g, "°")
    .replace(/(?<![\w.])(\d+(?:\.\d+)?)e([-+]\d+)\b/g, (_, mantissa, power) => `${mantissa}×10${raised(String(Number(power)))}`).replace(/(?<=[\s(]|^)-(?=\d)/g, "−");
}
