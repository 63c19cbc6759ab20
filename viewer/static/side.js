// The panel at the side: verdict, values with sigmas, decisions.
const of = (id) => document.getElementById(id);
const figure = (value, digits = 5) => typeof value === "number" ? String(Number(value.toPrecision(digits))) : String(value);
export const list = (value, digits) => Array.isArray(value) ? `(${value.map((each) => figure(each, digits)).join(", ")})` : figure(value, digits);
// A value with its sigma, both to the second digit of the sigma; elements of a list each by its own.
function measured(value, sigma, digits) {
  if (sigma === null || sigma === undefined) return list(value, digits);
  const values = [value].flat(), sigmas = [sigma].flat();
  const decimals = values.map((_, index) => {
    const own = sigmas.length === 1 ? sigmas[0] : sigmas[index];
    return typeof own === "number" && own > 0 ? Math.min(Math.max(1 - Math.floor(Math.log10(own)), 0), 12) : null;
  });
  const shown = (numbers, plain) => numbers.map((each, index) => typeof each === "number" && decimals[index] !== null ? each.toFixed(decimals[index]) : figure(each, plain));
  const text = (numbers, many, plain) => Array.isArray(many) ? `(${shown(numbers, plain).join(", ")})` : shown(numbers, plain)[0];
  return `${text(values, value, digits)} ± ${text(sigmas, sigma, 2)}`;
}

const VALUES = [
  ["camera", "camera"], ["target", "target"], ["time", "utc"], ["pose from", "pose_source"], ["profile", "profile"],
  ["disk radius, px", "radius_px", 4], ["phase, deg", "phase_deg", 4],
  ["centre, px", "centre_px"], ["offset, px", "offset_px"], ["range factor", "range_factor", 6], ["range, free", "range_factor_free", 6],
  ["roll, deg", "roll_deg"], ["attitude, deg", "attitude_deg", 3], ["PSF sigma, px", "psf_sigma_px", 3],
  ["limb rms, px", "limb_rms_px", 3], ["limb, robust, px", "limb_robust_px", 3], ["limb points", "limb_points"], ["limb share that disagrees", "limb_disagreeing", 3],
];

// Rows whose place among the images of the same camera is stated where it is high.
const RANKS = { centre_px: "sigma_px", limb_rms_px: "limb_rms_px", offset_px: "offset_px" };

export function showSide(page, row) {
  const result = page.result ?? {};
  of("product-name").textContent = page.product;
  of("verdict").replaceChildren(marked(row.status ?? result.status ?? "unknown"), row.review ? " " : "", row.review ? marked(row.review) : "");
  of("reason").textContent = row.reason ?? "";
  of("rank").textContent = page.worst ? `Worst first: ${page.worst}` : "";
  showAdvice(page.advice ?? []);
  showTried(page.tried ?? []);
  showRun(page.run);
  of("failed-later").hidden = !page.failed_later;
  of("failed-later").textContent = page.failed_later ? `The latest attempt failed; this product is from an earlier one. Reason of the failure: ${page.failed_later}` : "";
  const rows = VALUES.map(([name, key, digits]) => [name, result[key] ?? row[key], result.uncertainty?.[key], digits, key]).filter(([, value]) => value !== null && value !== undefined);
  if (result.similarity?.after !== undefined && result.similarity?.after !== null) rows.push(["similarity", `${figure(result.similarity.before, 3)} → ${figure(result.similarity.after, 3)}`]);
  const patches = result.patches;
  if (patches?.sigma_map_px) {
    rows.push(["patches that agree", `${patches.agreeing} of ${patches.tried}`]);
    rows.push(["place on the map", `± ${figure(patches.sigma_map_px, 2)} px of the map (${figure(patches.sigma_map_px * patches.map_pixel_km, 2)} km)`]);
    if (!patches.limb_points) rows.push(["close-up", "no limb: a large sigma of the centre says nothing about latitude and longitude"]);
  }
  if (result.orientation?.markings) rows.push(["orientation", result.orientation.markings]);
  for (const [name, value] of Object.entries(result.guidance ?? {})) if (value !== null && String(value) !== "") rows.push([name.replaceAll("_", " "), value]);
  for (const text of result.warnings ?? []) rows.push(["warning", text]);
  of("values").tBodies[0].replaceChildren(...rows.map(([name, value, sigma, digits, key]) => {
    const line = document.createElement("tr"), head = document.createElement("th");
    head.textContent = name;
    line.append(head);
    const second = page.other?.[key];
    const differs = second !== undefined && second !== null && String(second) !== String(value) ? `\nother: ${list(second, digits)}` : "";
    const rank = page.ranks?.[RANKS[key]];
    const place = rank >= 0.9 ? `\n${key === "centre_px" ? "sigma " : ""}larger than ${Math.floor(100 * rank)} % of this camera's` : "";
    line.insertCell().textContent = measured(key === "utc" ? String(value).slice(0, 19).replace("T", " ") : value, sigma, digits) + differs + place;
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

// Meaning and remedy of each code in the reason.
function showAdvice(advice) {
  of("advice").hidden = !advice.length;
  of("advice").querySelector("dl").replaceChildren(...advice.flatMap(({ code, meaning, remedy }) => {
    const head = document.createElement("dt"), text = document.createElement("dd"), todo = document.createElement("dd");
    [head.textContent, text.textContent, todo.textContent] = [code, plain(meaning), `To do: ${plain(remedy)}`];
    return [head, text, todo];
  }));
}
// The texts are Markdown with code and links.
const plain = (text) => text.replaceAll("`", "").replace(/\[([^\]]+)\]\([^)]*\)/g, "$1");

function showTried(tried) {
  of("tried").hidden = !tried.length;
  const best = tried.reduce((found, each) => (!found || each.likeness > found.likeness ? each : found), null);
  of("tried").querySelector("tbody").replaceChildren(...tried.map((each) => {
    const line = document.createElement("tr");
    if (each === best) line.className = "best";
    line.title = each.fault ?? "";
    const name = each.tried.replaceAll("-", " ");
    for (const text of [name, each.likeness?.toFixed(3), each.size?.toFixed(3), each.limb_px?.toFixed(2) ?? "not measured"]) line.insertCell().textContent = text ?? "";
    return line;
  }));
}

function showRun(run) {
  of("run").hidden = !run?.url;
  if (run?.url) Object.assign(of("run").querySelector("a"), { href: run.url, textContent: run.name || run.flow_run, title: run.at ?? "" });
}

function marked(text) {
  const span = document.createElement("strong");
  span.textContent = text;
  span.className = text;
  return span;
}
