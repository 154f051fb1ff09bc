// The connection to the viewer. It reconnects when the viewer was restarted.

const RETRY_MS = 700;

/** Connects; `handlers` are `text(object)`, `tiles(DataView)`, `path(first, Float32Array)`, `odometry(first, Float32Array)`, `picture(DataView)`,
 *  `state(word)` and `reset()`. */
export function connect(handlers) {
  const token = new URLSearchParams(location.search).get("token");
  const url = new URL("live", location.href);
  url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
  url.search = token ? `?token=${encodeURIComponent(token)}` : "";
  let socket = null;
  let over = false;

  const open = () => {
    handlers.state("connecting");
    socket = new WebSocket(url);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      handlers.reset();
      handlers.state("live");
    };
    socket.onmessage = ({ data }) => (typeof data === "string" ? handlers.text(JSON.parse(data)) : binary(data, handlers));
    socket.onclose = ({ code }) => {
      over = over || code === 1001;
      handlers.state(over ? "over" : "lost");
      if (!over) setTimeout(open, RETRY_MS);
    };
  };
  open();
  return {
    send: (command) => socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(command)),
    /** The run is ending: do not reconnect. */
    expectEnd: () => { over = true; },
  };
}

function binary(data, handlers) {
  const view = new DataView(data);
  switch (view.getUint8(0)) {
    case 3:
    case 4:
      return handlers.picture(view);
    case 1:
      return handlers.tiles(view);
    case 2:
      return handlers.path(view.getUint32(4, true), new Float32Array(data, 8));
    case 5:
      return handlers.odometry(view.getUint32(4, true), new Float32Array(data, 8));
  }
}
