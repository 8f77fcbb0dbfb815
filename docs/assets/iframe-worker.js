// Browsers refuse workers in pages that are opened from a folder. There the search runs in a hidden frame instead.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super()
      const frame = document.body.appendChild(Object.assign(document.createElement("iframe"), { hidden: true }))
      this.inside = frame.contentWindow
      const page = this.inside.document
      page.open()
      page.write("<body></body>")
      page.close()
      this.inside.postMessage = (data) => setTimeout(() => this.dispatchEvent(new MessageEvent("message", { data })))
      const load = (src) => new Promise((done) => {
        page.body.appendChild(Object.assign(page.createElement("script"), { src, onload: done }))
      })
      this.inside.importScripts = (...urls) => Promise.all(urls.map(load))
      this.ready = load(url)
    }
    postMessage(data) {
      this.ready.then(() => this.inside.dispatchEvent(new MessageEvent("message", { data })))
    }
    terminate() {}
  }
}
