// A page that is opened as a file may start no worker: a hidden frame does the work of the search in its place.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      document.body.appendChild(this.frame);
      const inner = this.frame.contentWindow;
      inner.document.open();
      inner.document.write(
        "<script>postMessage = (data) => parent.postMessage(data, '*');" +
          "importScripts = (...urls) => urls.reduce((done, url) => done.then(() => new Promise((resolve) => {" +
          "const script = document.createElement('script'); script.src = url; script.onload = resolve;" +
          "document.body.appendChild(script); })), Promise.resolve());</scr" +
          'ipt><script src="' + url + '"></scr' + "ipt>"
      );
      inner.document.close();
      this.ready = new Promise((resolve) => (inner.onload = resolve)); // opening a document forgets listeners
      this.listener = (event) => {
        if (event.source !== inner) return;
        const message = new MessageEvent("message", { data: event.data });
        this.dispatchEvent(message);
        if (this.onmessage) this.onmessage(message);
      };
      window.addEventListener("message", this.listener);
    }
    postMessage(data) {
      this.ready.then(() => this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data })));
    }
    terminate() {
      window.removeEventListener("message", this.listener);
      this.frame.remove();
    }
  };
}
