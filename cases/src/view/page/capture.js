// Pictures and films of what is seen, as downloads.

/** Both canvases on one. */
function compose(onto, layers, background) {
  onto.width = layers[0].width;
  onto.height = layers[0].height;
  const context = onto.getContext("2d");
  context.fillStyle = background;
  context.fillRect(0, 0, onto.width, onto.height);
  for (const layer of layers) context.drawImage(layer, 0, 0, onto.width, onto.height);
}

function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** Downloads a PNG of layers that have just been drawn. */
export function picture(layers, background, name) {
  const canvas = document.createElement("canvas");
  compose(canvas, layers, background);
  canvas.toBlob((blob) => download(blob, `${name}.png`), "image/png");
}

const FORMATS = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm", "video/mp4"];

/**
 * Films states: `show(n)` draws one and resolves when it is seen. A film lasts as long as its recording: a state is seen for
 * `pause` ms, or for as long as it takes to load. `stopped()` ends it early.
 */
export async function film({ states, show, layers, background, pause, stopped, name }) {
  const format = FORMATS.find((f) => window.MediaRecorder?.isTypeSupported(f));
  if (!format) throw new Error("this browser cannot record films");
  const canvas = document.createElement("canvas");
  await show(states[0]);
  compose(canvas, layers, background());
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
    compose(canvas, layers, background());
    track.requestFrame();
    await new Promise((resolve) => setTimeout(resolve, Math.max(pause - (performance.now() - start), 0)));
  }
  recorder.stop();
  await ended;
  download(new Blob(parts, { type: format }), `${name}.${format.includes("mp4") ? "mp4" : "webm"}`);
}
