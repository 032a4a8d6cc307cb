// Where pages are opened as files, browsers refuse workers, with which the theme's search runs. This one runs in a frame.
if (location.protocol === "file:")
    window.Worker = window.IFrameWorker = class extends EventTarget {
        constructor(url) {
            super();
            this.frame = document.createElement("iframe");
            this.frame.hidden = true;
            const to_parent = "window.postMessage = data => parent.postMessage(data, '*')";
            this.frame.srcdoc = `<script>${to_parent}<\/script><script src="${new URL(url, document.baseURI)}"><\/script>`;
            this.ready = new Promise(done => this.frame.addEventListener("load", done, {once: true}));
            addEventListener("message", event => {
                if (event.source !== this.frame.contentWindow) return;
                event.stopImmediatePropagation();
                this.dispatchEvent(new MessageEvent("message", {data: event.data}));
            });
            document.documentElement.append(this.frame);
        }
        postMessage(data) { this.ready.then(() => this.send(data)); }
        send(data) { this.frame.contentWindow.dispatchEvent(new MessageEvent("message", {data})); }
        terminate() { this.frame.remove(); }
    };
