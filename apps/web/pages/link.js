// The pages' connection to their program. A browser opens six to a server, and each page's events would hold one: this script
// runs once more as a worker that all tabs share, which holds one for all that are looked at. A connection that was silent for
// longer than the program ever is, is replaced: behind a laptop's sleep nothing says that it is dead.
"use strict";
const SILENT_MS = 3000, ACTING_MS = 1200, ACTION_MS = 3000;  // the program is never silent for longer than a second

async function post(action, token, limit) {
  const answer = await fetch("/" + action, {method: "POST", headers: {"X-Token": token}, signal: AbortSignal.timeout(limit)});
  const text = (await answer.text()).trim();
  if (!answer.ok) throw new Error(text);
  return text;
}

// Returns what a new tab's port is given to.
function serveTabs() {
  const tabs = new Set(), told = new WeakMap(), heard = {};
  let source = null, last = 0, acted = -Infinity;
  const tell = (tab, kind, data) => tab.postMessage({kind, data});
  function hear(kind, data) {
    last = performance.now();
    const same = kind === "hello" && heard.hello && heard.hello.token === data.token;
    if (same) kind = "still";  // the same run, by a new connection
    if (kind === "hello") heard.news = heard.end = undefined;
    heard[kind] = data;
    for (const tab of tabs) tell(tab, kind, data), told.set(tab, heard.hello);
  }
  function open() {
    if (source) source.close();
    last = performance.now();
    source = new EventSource("/events");
    for (const [event, kind] of [["hello", "hello"], ["message", "news"], ["end", "end"], ["still", "still"]])
      source.addEventListener(event, (e) => hear(kind, JSON.parse(e.data)));
  }
  function watch() {
    const now = performance.now(), limit = now - acted < 10000 ? ACTING_MS : SILENT_MS;
    if (tabs.size > 0 && (!source || now - last > limit)) open();
    if (tabs.size > 0 || !source) return;
    source.close();
    source = null;
  }
  setInterval(watch, 250);
  return (tab) => {
    tab.onmessage = async ({data: {looked, action, token, limit, id}}) => {
      if (looked === false) tabs.delete(tab);
      if (looked || action) tabs.add(tab);
      watch();
      if (looked && heard.hello && told.get(tab) !== heard.hello)
        for (const kind of ["hello", "news", "end"]) if (heard[kind]) tell(tab, kind, heard[kind]), told.set(tab, heard.hello);
      if (!action) return;
      acted = performance.now();
      try {
        tell(tab, "answer", {id, text: await post(action, token, limit)});
      } catch (error) {
        tell(tab, "answer", {id, error: error.message});
      }
    };
  };
}

if (typeof document === "undefined") {
  const serve = serveTabs();
  self.onconnect = (e) => serve(e.ports[0]);
}

// The page's end. `on` has what is done with "hello", "news" and "end".
class Link {
  constructor(on) {
    this.on = on;
    this.alive = -Infinity;
    this.answers = new Map();
    this.hello = null;
    const here = () => {
      const {port1, port2} = new MessageChannel();
      serveTabs()(port1);
      this.use(port2);
    };
    if (!window.SharedWorker) return here();
    const worker = new SharedWorker("/link.js");
    worker.onerror = here;
    this.use(worker.port);
  }

  use(port) {
    this.port = port;
    port.onmessage = ({data: {kind, data}}) => this.receive(kind, data);
    const look = () => port.postMessage({looked: !document.hidden});
    document.addEventListener("visibilitychange", look);
    addEventListener("pageshow", look);
    addEventListener("pagehide", () => port.postMessage({looked: false}));
    look();
  }

  receive(kind, data) {
    if (kind === "answer") return this.answers.get(data.id)?.(data);
    this.alive = performance.now();
    if (kind === "hello") this.hello = data;
    if (this.on[kind]) this.on[kind](data);
  }

  away() { return !this.hello || performance.now() - this.alive > SILENT_MS + 500; }

  // By the worker that all share, or by this page alone.
  ask(action, way, limit) {
    if (!this.hello) return Promise.reject(new Error("no connection"));
    if (way === "page") return post(action, this.hello.token, limit);
    const id = Math.random();
    return new Promise((done, fail) => {
      this.answers.set(id, ({text, error}) => error ? fail(new Error(error)) : done(text));
      setTimeout(() => fail(new Error("no answer")), limit + 100);
      this.port.postMessage({action, token: this.hello.token, limit, id});
    }).finally(() => this.answers.delete(id));
  }

  // The program's answer, or why there is none. `wanted` (n): whether to try again after n attempts; each goes both ways at
  // once, and the first are short, for a connection may be dead and a new one is not.
  async act(action, wanted) {
    for (let n = 1;; ++n) {
      const begin = performance.now();
      try {
        const limit = wanted ? Math.min(ACTION_MS, 400 * n) : ACTION_MS, ways = wanted ? ["worker", "page"] : ["worker"];
        return await Promise.any(ways.map((way) => this.ask(action, way, limit)));
      } catch ({errors: [error]}) {
        if (!wanted || !wanted(n)) return "the program did not answer: " + error.message;
      }
      await new Promise((done) => setTimeout(done, Math.max(0, begin + 300 - performance.now())));
    }
  }
}
