// Filters as people type them, with the grammar of viewer/filters.py: `sigma > 0.1 and status = doubtful`.
export const ALIASES = {
  sigma: "sigma_px", offset: "offset_px", verdict: "status", limb: "limb_rms_px", phase: "phase_deg",
  range: "range_km", resolution: "resolution_km", radius: "radius_px", turn: "attitude_deg",
  similarity: "similarity_after", time: "utc",
};
const TOKEN = /\s*(?:(>=|<=|!=|==|!~|[><=~()])|"([^"]*)"|'([^']*)'|([^\s()<>=!~"']+))/y;
const OPERATORS = new Set([">", ">=", "<", "<=", "=", "==", "!=", "~", "!~"]);

function tokensOf(text) {
  const tokens = [];
  TOKEN.lastIndex = 0;
  text = text.trimEnd();
  while (TOKEN.lastIndex < text.length) {
    const at = TOKEN.lastIndex, found = TOKEN.exec(text);
    if (!found) throw new Error(`the filter: "${text.slice(at).trim()}" cannot be read.`);
    const quoted = found[2] ?? found[3];
    const word = quoted ?? found[1] ?? found[4];
    const key = quoted === undefined && ["and", "or", "not", "(", ")"].includes(word.toLowerCase()) ? word.toLowerCase() : "";
    tokens.push({ text: word, key, operator: quoted === undefined && OPERATORS.has(word) });
  }
  return tokens;
}

const COMPARE = {
  ">": (a, b) => a > b, ">=": (a, b) => a >= b, "<": (a, b) => a < b, "<=": (a, b) => a <= b,
  "=": (a, b) => a === b, "==": (a, b) => a === b, "!=": (a, b) => a !== b,
};

// A function of a row (an object) that says whether it fits. kinds: text, number or time, by column.
export function makeFilter(text, kinds) {
  const rest = tokensOf(text), texts = Object.keys(kinds).filter((name) => kinds[name] === "text");
  if (!rest.length) return () => true;
  const has = (value, word) => String(value ?? "").toLowerCase().includes(word.toLowerCase());

  function compared(name, operator, value) {
    const column = ALIASES[name.toLowerCase()] ?? name.toLowerCase();
    if (!(column in kinds)) throw new Error(`the filter: there is no column "${name}"; known are ${[...Object.keys(ALIASES), ...Object.keys(kinds)].join(", ")}.`);
    if (operator === "~") return (row) => has(row[column], value);
    if (operator === "!~") return (row) => !has(row[column], value);
    const known = (row) => row[column] !== null && row[column] !== undefined && row[column] !== "";
    const how = COMPARE[operator];
    if (kinds[column] === "number") {
      const number = value.trim() === "" ? NaN : Number(value);
      if (Number.isNaN(number)) throw new Error(`the filter: ${name} is a number, "${value}" is none.`);
      return (row) => known(row) && how(Number(row[column]), number);
    }
    if (kinds[column] === "time") {
      const moment = Date.parse(/\d{4}-\d\d-\d\dT[\d:.]+$/.test(value) ? `${value}Z` : value);
      if (Number.isNaN(moment)) throw new Error(`the filter: "${value}" is no time; write 1979-03-04.`);
      return (row) => known(row) && how(Date.parse(row[column]), moment);
    }
    const wanted = value.toLowerCase();
    return (row) => row[column] !== null && row[column] !== undefined && how(String(row[column]).toLowerCase(), wanted);
  }
  function single() {
    if (!rest.length) throw new Error("the filter: it ends where something is expected.");
    const token = rest.shift();
    if (token.key === "not") { const inner = single(); return (row) => !inner(row); }
    if (token.key === "(") {
      const inner = alternatives();
      if (!rest.length || rest.shift().key !== ")") throw new Error("the filter: a parenthesis is not closed.");
      return inner;
    }
    if (token.key || token.operator) throw new Error(`the filter: "${token.text}" is not expected here.`);
    if (rest[0]?.operator) {
      const operator = rest.shift().text;
      if (!rest.length || rest[0].key || rest[0].operator) throw new Error(`the filter: ${token.text} ${operator} lacks a value.`);
      return compared(token.text, operator, rest.shift().text);
    }
    return (row) => texts.some((name) => has(row[name], token.text));
  }
  function together() {
    let all = [single()];
    while (rest.length && rest[0].key !== "or" && rest[0].key !== ")") {
      if (rest[0].key === "and") rest.shift();
      all.push(single());
    }
    return (row) => all.every((fits) => fits(row));
  }
  function alternatives() {
    const any = [together()];
    while (rest.length && rest[0].key === "or") { rest.shift(); any.push(together()); }
    return (row) => any.some((fits) => fits(row));
  }
  const found = alternatives();
  if (rest.length) throw new Error(`the filter: "${rest[0].text}" is not expected here.`);
  return found;
}
