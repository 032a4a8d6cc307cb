// A headless Chromium, driven by the DevTools protocol through the browser's own pipe; needs Node.js and Chromium, nothing
// else. Where there is no browser (BROWSER names one) the program that imports this ends with 77, which CTest takes for
// "skipped"; with ETENDUE_NEEDS_BROWSER set, as in CI, that is a failure.

import {spawn, spawnSync} from 'node:child_process';
import {mkdtempSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';

const kSkipped = 77;

const browserName = [process.env.BROWSER, 'chromium', 'chromium-browser', 'google-chrome']
    .find(name => name && spawnSync(name, ['--version']).status === 0);
if (!browserName) {
    console.log(process.env.ETENDUE_NEEDS_BROWSER ? 'FAIL no Chromium here' : 'skipped: no Chromium here');
    process.exit(process.env.ETENDUE_NEEDS_BROWSER ? 1 : kSkipped);
}

/// A page of a headless browser.
export class Browser {
    /// `flags`: of the browser; `screenshots`: a folder for them, or nothing.
    constructor({flags, screenshots}) {
        this.screenshots = screenshots;
        this.profile = mkdtempSync(join(tmpdir(), 'etendue-browser-'));
        this.process = spawn(browserName, ['--headless=new', '--remote-debugging-pipe', '--no-sandbox',
            '--no-first-run', ...flags, '--force-device-scale-factor=1', '--window-size=1400,1000',
            `--user-data-dir=${this.profile}`], {stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe']});
        this.complaints = [];
        this.requests = [];
        this.waiting = new Map();
        this.listeners = new Map();
        this.last = 0;
        let buffer = '';
        this.process.stdio[4].on('data', chunk => {
            const messages = (buffer + chunk).split('\0');
            buffer = messages.pop();
            messages.forEach(m => this.receive(JSON.parse(m)));
        });
    }

    receive({id, method, params, result, error}) {
        if (id) {
            const {fulfil, reject} = this.waiting.get(id);
            this.waiting.delete(id);
            error ? reject(new Error(error.message)) : fulfil(result);
            return;
        }
        if (method === 'Runtime.exceptionThrown')
            this.complaints.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
        if (method === 'Log.entryAdded' && params.entry.level !== 'verbose' && params.entry.level !== 'info')
            this.complaints.push(params.entry.text);
        if (method === 'Runtime.consoleAPICalled' && ['error', 'warning', 'assert'].includes(params.type))
            this.complaints.push(JSON.stringify(params.args));
        if (method === 'Network.requestWillBeSent') this.requests.push(params.request.url);
        this.listeners.get(method)?.(params);
    }

    send(method, params = {}) {
        const id = ++this.last;
        const message = {id, method, params};
        if (this.session) message.sessionId = this.session;
        return new Promise((fulfil, reject) => {
            this.waiting.set(id, {fulfil, reject});
            this.process.stdio[3].write(JSON.stringify(message) + '\0');
        });
    }

    async open(url) {
        const {targetId} = await this.send('Target.createTarget', {url: 'about:blank'});
        this.session = (await this.send('Target.attachToTarget', {targetId, flatten: true})).sessionId;
        for (const domain of ['Page', 'Runtime', 'Log', 'Network']) await this.send(`${domain}.enable`);
        const loaded = new Promise(fulfil => this.listeners.set('Page.loadEventFired', fulfil));
        await this.send('Page.navigate', {url});
        await loaded;
    }

    async evaluate(expression) {
        const {result, exceptionDetails} = await this.send('Runtime.evaluate',
            {expression, awaitPromise: true, returnByValue: true});
        if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
        return result.value;
    }

    async until(expression, what, seconds = 60) {
        for (let i = 0; i < 10 * seconds; ++i) {
            if (await this.evaluate(`Boolean(${expression})`)) return;
            await new Promise(r => setTimeout(r, 100));
        }
        throw new Error(`${what}: not within ${seconds} s`);
    }

    /// Two frames, so that what was asked for is drawn.
    settle() { return this.evaluate('new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))'); }

    mouse(type, x, y, more = {}) {
        return this.send('Input.dispatchMouseEvent',
            {type, x, y, button: 'left', buttons: type === 'mouseReleased' ? 0 : 1, clickCount: 1, ...more});
    }
    async drag([x0, y0], [x1, y1]) {
        await this.mouse('mousePressed', x0, y0);
        for (const f of [0.25, 0.5, 0.75, 1]) await this.mouse('mouseMoved', x0 + f * (x1 - x0), y0 + f * (y1 - y0));
        await this.mouse('mouseReleased', x1, y1);
        await this.settle();
    }
    async wheel([x, y], deltaY) {
        await this.send('Input.dispatchMouseEvent', {type: 'mouseWheel', x, y, deltaX: 0, deltaY});
        await new Promise(r => setTimeout(r, 200));
        await this.settle();
    }

    async screenshot(name) {
        if (!this.screenshots) return;
        await this.settle();
        const {data} = await this.send('Page.captureScreenshot', {format: 'png'});
        writeFileSync(join(this.screenshots, `${name}.png`), Buffer.from(data, 'base64'));
    }

    close() {
        this.process.kill();
        // Its helper processes may outlive it by a moment, and still write to the profile.
        const remove = tries => {
            try {
                rmSync(this.profile, {recursive: true, force: true});
            } catch (error) {
                if (tries === 0) throw error;
                setTimeout(remove, 200, tries - 1);
            }
        };
        this.process.on('exit', () => remove(25));
    }
}
