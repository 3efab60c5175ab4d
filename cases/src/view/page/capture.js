// Pictures and films of what is seen, as downloads.

/** Largest side of what the graphics card draws at once, pixels. */
const TILE = 2048;

/** Largest side of a picture in a browser, pixels. */
export const MOST_PIXELS = 16_384;

/** Widths that are offered, pixels. */
export const WIDTHS = [1920, 3840, 7680];

/** What is seen, `width` pixels wide, on a canvas: text and lines grow with it. */
export function painted(viewer, width) {
  const stage = viewer.panels[0].element.parentElement.getBoundingClientRect();
  const [wide, tall] = [Math.max(stage.width, 1), Math.max(stage.height, 1)];
  const ratio = Math.min(width, MOST_PIXELS, (MOST_PIXELS * wide) / tall) / wide;
  const onto = document.createElement("canvas");
  [onto.width, onto.height] = [Math.round(wide * ratio), Math.round(tall * ratio)];
  const context = onto.getContext("2d");
  context.fillStyle = viewer.stage;
  context.fillRect(0, 0, onto.width, onto.height);
  for (const panel of viewer.panels) {
    const box = panel.element.getBoundingClientRect();
    const [left, top] = [Math.round((box.left - stage.left) * ratio), Math.round((box.top - stage.top) * ratio)];
    const whole = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
    for (let y = 0; y < whole[1]; y += TILE) {
      for (let x = 0; x < whole[0]; x += TILE) {
        const part = [x, y, Math.min(TILE, whole[0] - x), Math.min(TILE, whole[1] - y)];
        viewer.drawPart(panel, part, whole, ratio);
        context.drawImage(panel.canvas, left + x, top + y);
      }
    }
    const text = document.createElement("canvas");
    [text.width, text.height] = whole;
    viewer.write(panel, text, ratio);
    context.drawImage(text, left, top);
  }
  viewer.drawNow();
  return onto;
}

function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** Downloads a PNG of what is seen. */
export function picture(viewer, width, name) {
  painted(viewer, width).toBlob((blob) => download(blob, `${name}.png`), "image/png");
}

const FORMATS = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm", "video/mp4"];

/**
 * Films states: `show(n)` draws one and resolves when it is seen. A film lasts as long as its recording: a state is seen for
 * `pause` ms, or for as long as it takes to load. `stopped()` ends it early.
 */
export async function film({ states, show, viewer, width, pause, stopped, name }) {
  const format = FORMATS.find((f) => window.MediaRecorder?.isTypeSupported(f));
  if (!format) throw new Error("this browser cannot record films");
  await show(states[0]);
  const canvas = painted(viewer, width);
  const context = canvas.getContext("2d");
  const stream = canvas.captureStream(0);
  const [track] = stream.getVideoTracks();
  const recorder = new MediaRecorder(stream, { mimeType: format, videoBitsPerSecond: 12e6 });
  const parts = [];
  recorder.ondataavailable = (event) => parts.push(event.data);
  const ended = new Promise((resolve) => (recorder.onstop = resolve));
  recorder.start(500);
  for (const state of states) {
    if (stopped()) break;
    const start = performance.now();
    await show(state);
    context.drawImage(painted(viewer, width), 0, 0, canvas.width, canvas.height);
    track.requestFrame();
    await new Promise((resolve) => setTimeout(resolve, Math.max(pause - (performance.now() - start), 0)));
  }
  recorder.stop();
  await ended;
  download(new Blob(parts, { type: format }), `${name}.${format.includes("mp4") ? "mp4" : "webm"}`);
}
