// Helping a correction: the dragged disk, range, roll, holds, a painted mask; doing it again; before and after.
import { backend } from "./api.js";
import { list } from "./side.js";

const POLL_MS = 400;
const COMPARED = [
  ["verdict", "status"], ["centre, px", "centre_px"], ["range factor", "range_factor"], ["roll, deg", "roll_deg"],
  ["attitude, deg", "attitude_deg"], ["limb rms, px", "limb_rms_px"], ["limb, robust, px", "limb_robust_px"],
];

export class Help {
  constructor(picture, on) {
    Object.assign(this, { picture, on });
    this.of = (id) => document.getElementById(id);
    for (const id of ["help-x", "help-y", "help-range", "help-roll"]) this.of(id).addEventListener("input", () => this.fromFields());
    this.of("help-panel").addEventListener("toggle", () => this.toggled());
    this.of("paint").addEventListener("click", () => this.paint());
    this.of("clear-mask").addEventListener("click", () => { picture.mask = null; picture.redraw(); });
    this.of("help-best").addEventListener("click", () => this.toBest());
    this.of("redo").addEventListener("click", () => this.redo().catch(on.fault));
  }

  // The panel's own event comes later than the next click may.
  toggle() { this.of("help-panel").open = !this.of("help-panel").open; this.toggled(); }

  get open() { return this.of("help-panel").open && Boolean(this.picture.page); }
  get painting() { return this.of("paint").ariaPressed === "true"; }

  shown(page) {
    this.page = page;
    this.moved = false;
    for (const id of ["log", "before-after", "progress"]) this.of(id).hidden = true;
    this.of("help-range").value = 1;
    this.of("help-roll").value = 0;
    const [x, y] = page?.predicted_centre_px ?? ["", ""];
    this.of("help-x").value = x;
    this.of("help-y").value = y;
    this.toggled();
  }

  toggled() {
    const { picture } = this, [x, y] = picture.page?.predicted_centre_px ?? [];
    picture.help = this.open && x !== undefined ? { x, y, range: 1, roll: 0 } : null;
    if (picture.help) this.fromFields(false);
    if (!this.open) this.of("paint").ariaPressed = "false";
    picture.redraw();
  }

  fromFields(moved = true) {
    if (!this.picture.help) return;
    const value = (id) => Number(this.of(id).value);
    this.picture.help = { x: value("help-x"), y: value("help-y"), range: value("help-range") || 1, roll: value("help-roll") };
    this.moved ||= moved;
    this.picture.redraw();
  }

  nudge(dx, dy) {
    if (!this.picture.help) return;
    this.of("help-x").value = (this.picture.help.x + dx).toFixed(2);
    this.of("help-y").value = (this.picture.help.y + dy).toFixed(2);
    this.fromFields();
  }

  // The disk to where the corrected limb is, or of a failed image the one that was most like it.
  toBest() { if (this.page?.centre_px) this.put(this.page.centre_px); }

  put([x, y]) {
    if (!this.picture.help) return;
    [this.of("help-x").value, this.of("help-y").value] = [x.toFixed(2), y.toFixed(2)];
    this.fromFields();
  }

  // What a drag that begins here does: the disk within and near its outline.
  dragKind([x, y]) {
    if (!this.open) return null;
    if (this.painting) return "paint";
    const { help, scale } = this.picture, outline = help ? this.picture.helpOutline().filter(Boolean) : [];
    if (!outline.length) return null;
    const radius = Math.max(...outline.map((point) => Math.hypot(point[0] - help.x, point[1] - help.y)));
    return Math.hypot(x - help.x, y - help.y) < radius + 12 / scale ? "disk" : null;
  }

  drag(kind, place, step) {
    if (kind === "disk") this.nudge(...step);
    else if (kind === "paint") this.dab(place);
  }

  paint() {
    const pressed = !this.painting;
    this.of("paint").ariaPressed = String(pressed);
  }

  dab([x, y]) {
    const { picture } = this, [nx, ny] = picture.page.size_px;
    picture.mask ??= new OffscreenCanvas(nx, ny);
    const context = picture.mask.getContext("2d");
    context.fillStyle = "#e69f00";
    context.beginPath();
    context.arc(x + 0.5, y + 0.5, Math.max(Number(this.of("brush").value) / 2, 0.5), 0, 7);
    context.fill();
    picture.redraw();
  }

  async given() {
    const { help, mask } = this.picture;
    const held = [...document.querySelectorAll('#help-panel input[name="hold"]:checked')].map((box) => box.value);
    const centre = help && this.moved ? [help.x, help.y].map((value, i) => value + this.page.first_px[i]) : null;
    return {
      centre_px: centre, range_factor: help?.range ?? 1, roll_deg: help?.roll ?? 0, hold: held,
      profile: this.of("help-profile").value.trim() || null, mask: mask ? await inBase64(mask) : null,
    };
  }

  async redo() {
    const { page } = this, before = page.result ?? {}, log = this.of("log"), progress = this.of("progress");
    const button = this.of("redo");
    button.disabled = true;
    try {
      const help = await this.given();
      // Without anything new the image is done again by the help that stands.
      if (isHelp(help)) await backend.decide(page.product, { action: "help", why: this.of("help-why").value, help });
      let job = await backend.redo(page.product);
      for (const element of [log, progress]) element.hidden = false;
      this.picture.earlier = { product: page.product, limb: page.curves?.after.limb ?? [] };
      while (job.status === "running") {
        await new Promise((wake) => setTimeout(wake, POLL_MS));
        job = await backend.job(job.number);
        log.textContent = [...job.done.map((step) => `${step} done`), job.step ? `${job.step} ...` : "", ...job.lines.slice(-6)].join("\n");
        log.scrollTop = log.scrollHeight;
      }
      progress.hidden = true;
      log.textContent = `${job.status}${job.reason ? `: ${job.reason}` : ""}`;
      await this.on.redone(page.product);
      this.compare(before, job.result ?? {});
    } finally { button.disabled = false; progress.hidden = true; }
  }

  compare(before, after) {
    const table = this.of("before-after");
    const text = (of, name) => {
      const sigma = of.uncertainty?.[name];
      return list(of[name] ?? "none", 5) + (sigma === null || sigma === undefined ? "" : `\n± ${list(sigma, 2)}`);
    };
    table.tBodies[0].replaceChildren(...COMPARED.map(([head, name]) => {
      const row = document.createElement("tr"), first = document.createElement("th");
      first.textContent = head;
      row.append(first);
      for (const each of [before, after]) row.insertCell().textContent = text(each, name);
      return row;
    }));
    table.hidden = false;
    this.of("log").hidden = false;
    table.scrollIntoView({ block: "nearest" });
  }
}

const isHelp = (help) => Boolean(help.centre_px || help.range_factor !== 1 || help.roll_deg || help.hold.length || help.profile || help.mask);

async function inBase64(canvas) {
  const bytes = new Uint8Array(await (await canvas.convertToBlob({ type: "image/png" })).arrayBuffer());
  let text = "";
  for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
  return btoa(text);
}
