// Numbers and units as in the pictures and reports of the program. The rules come with `run.json`.

/** 0 degrees Celsius, K. */
const ZERO_CELSIUS = 273.15;

let rules = [];
let celsius = false;

export function setRules(known) {
  rules = known;
}

/** Whether temperatures are shown in degrees Celsius. */
export function setCelsius(on) {
  celsius = on;
}

/**
 * The unit in which numbers up to this size are shown, and how: times `factor`, plus `offset`. `shown` is the unit where no rule
 * holds.
 */
export function unitFor(si, largest, shown = si) {
  if (celsius && si === "K") return { factor: 1, offset: -ZERO_CELSIUS, unit: "°C" };
  const size = largest === 0 ? 1 : Math.abs(largest);
  const rule = rules.find((r) => r.si === si && size >= r.from);
  return rule ? { factor: rule.factor, offset: 0, unit: rule.unit } : { factor: 1, offset: 0, unit: shown === "1" ? "" : shown };
}

/** The number that is shown for a value. */
export const toShown = (value, { factor, offset }) => (value === null ? null : value * factor + offset);

/** The value for which a number is shown. */
export const toValue = (number, { factor, offset }) => (number - offset) / factor;

/** With at most this many significant digits and no trailing zeros. */
export function number(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const exponent = Math.floor(Math.log10(Math.abs(value)));
  if (exponent < -4 || exponent >= 6) {
    const [mantissa, power] = value.toExponential(digits - 1).split("e");
    return `${trimmed(mantissa)}e${Number(power)}`.replace("-", "−").replace("e-", "e−");
  }
  return trimmed(value.toFixed(Math.max(digits - 1 - exponent, 0))).replace("-", "−");
}

function trimmed(text) {
  return text.includes(".") ? text.replace(/\.?0+$/, "") : text;
}

/** A value with its unit: `12 ms`. */
export function withUnit(value, si, shown = si, digits = 4) {
  if (value === null || !Number.isFinite(value)) return "–";
  const known = unitFor(si, value, shown);
  const { unit } = known;
  const text = number(toShown(value, known), digits);
  return unit ? `${text} ${unit}` : text;
}

/** A place (m): `10, −2.5, 0 mm`. */
export function placeText(place) {
  const { factor, unit } = unitFor("m", Math.max(...place.map(Math.abs)));
  return `${place.map((x) => number(x * factor, 4)).join(", ")} ${unit}`;
}

/** A label with its unit, if it has one. */
export function labelled(label, unit) {
  return unit ? `${label} (${unit})` : label;
}

/** Round numbers between two limits, about as many as wanted. */
export function ticks(low, high, wanted) {
  const span = high - low;
  if (!(span > 0) || !Number.isFinite(span)) return Number.isFinite(low) ? [low] : [];
  const rough = span / Math.max(wanted, 1);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * ([1, 2, 2.5, 5].find((s) => s * power >= rough) ?? 10);
  const found = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * span; n++) found.push(n * step);
  return found;
}
