// The panel at the side: verdict, values with sigmas, decisions.
const of = (id) => document.getElementById(id);
const figure = (value, digits = 5) => typeof value === "number" ? String(Number(value.toPrecision(digits))) : String(value);
const list = (value, digits) => Array.isArray(value) ? `(${value.map((each) => figure(each, digits)).join(", ")})` : figure(value, digits);

const VALUES = [
  ["camera", "camera"], ["target", "target"], ["time", "utc"], ["pose from", "pose_source"], ["profile", "profile"],
  ["centre, px", "centre_px"], ["offset, px", "offset_px"], ["range factor", "range_factor", 8], ["range, free", "range_factor_free", 6],
  ["roll, deg", "roll_deg"], ["attitude, deg", "attitude_deg", 3], ["PSF sigma, px", "psf_sigma_px", 3],
  ["limb rms, px", "limb_rms_px", 3], ["limb, robust, px", "limb_robust_px", 3], ["limb points", "limb_points"], ["limb disagreeing", "limb_disagreeing", 3],
];

export function showSide(page, row) {
  const result = page.result ?? {};
  of("product-name").textContent = page.product;
  of("verdict").replaceChildren(marked(row.status ?? result.status ?? "unknown"), row.review ? " " : "", row.review ? marked(row.review) : "");
  of("reason").textContent = row.reason ?? "";
  const rows = VALUES.map(([name, key, digits]) => [name, result[key] ?? row[key], result.uncertainty?.[key], digits, key]).filter(([, value]) => value !== null && value !== undefined);
  if (result.similarity?.after !== undefined && result.similarity?.after !== null) rows.push(["similarity", `${figure(result.similarity.before, 3)} → ${figure(result.similarity.after, 3)}`]);
  if (result.orientation?.markings) rows.push(["orientation", result.orientation.markings]);
  for (const [name, value] of Object.entries(result.guidance ?? {})) if (value !== null && String(value) !== "") rows.push([name.replaceAll("_", " "), value]);
  for (const text of result.warnings ?? []) rows.push(["warning", text]);
  of("values").tBodies[0].replaceChildren(...rows.map(([name, value, sigma, digits, key]) => {
    const line = document.createElement("tr"), head = document.createElement("th");
    head.textContent = name;
    line.append(head);
    const second = page.other?.[key];
    const differs = second !== undefined && second !== null && String(second) !== String(value) ? `\nother: ${list(second, digits)}` : "";
    line.insertCell().textContent = list(value, digits) + (sigma !== null && sigma !== undefined ? ` ± ${list(sigma, 2)}` : "") + differs;
    return line;
  }));
  of("decisions").replaceChildren(...(page.decisions ?? []).map((decision) => {
    const item = document.createElement("li");
    const options = Object.entries(decision.options ?? {}).map(([name, value]) => `${name} ${list(value)}`).join(", ");
    item.textContent = [`${decision.action} by ${decision.who}, ${decision.when.slice(0, 16).replace("T", " ")}`, decision.why, options].filter(Boolean).join(": ");
    if (decision.undone) { item.className = "undone"; item.title = `undone ${decision.undone}`; }
    return item;
  }).reverse());
}

function marked(text) {
  const span = document.createElement("strong");
  span.textContent = text;
  span.className = text;
  return span;
}
