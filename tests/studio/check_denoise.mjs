// The switch of `etendue studio` that removes noise, in a headless browser, with a library in the place of Open Image
// Denoise: the label, values, differences, the end of a run, filter modes, and what a missing library is told.
//
//     ETENDUE_FAKE_DENOISER=library node check_denoise.mjs etendue scene.xml [folder for screenshots]

import {readFileSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';

import {Studio, check, checkNames, differs, folder, key, openBrowser, pixels, runParts, sceneFile} from './page.mjs';

const label = "document.getElementById('label').textContent";
const press = id => `document.getElementById('${id}').click()`;
const choose = (id, value) => `(() => { const s = document.getElementById('${id}'); s.value = '${value}'; s.dispatchEvent(new Event('change')); })()`;
const post = body => `studio.server.post('/v1/run', ${JSON.stringify(body)})`;
const size = ['--resolution', '64x48'];
/// With a filter that is wider than a pixel.
const file = join(folder, 'wide.xml');
writeFileSync(file, readFileSync(sceneFile, 'utf8').replace('<rfilter type="box"/>', '<rfilter type="gaussian"/>'));

async function switchPart(browser) {
    await browser.until('studio.shown[0].passes >= 4', 'a rendering');
    await browser.evaluate(press('auto-exposure'));
    check(!await browser.evaluate(`${label}.includes('denoised')`), 'the image is not denoised unasked');
    await browser.screenshot('denoise-1-noisy');
    await browser.evaluate(press('denoise'));
    await browser.until(`${label}.startsWith('run 1, denoised, not unbiased, ')`, 'the denoised image while the run renders');
    await browser.settle();
    const denoised = await pixels(browser, 'view');
    await browser.screenshot('denoise-2-denoised');
    const passes = await browser.evaluate('studio.shown[0].passes');
    await browser.until(`studio.shown[0].passes > ${passes}`, 'it follows the run');
    check(await browser.evaluate("document.getElementById('view-choice').value === 'image'"), 'it stands in the place of the image');

    // Both modes of the filter.
    check(await browser.evaluate("!document.getElementById('denoise-spread').hidden"), 'the mode "spread" of a wide filter gains less');
    await browser.evaluate(press('start-sampling'));
    await browser.until("studio.shown[0].run === 2 && studio.runs.get(2)?.filter_mode === 'sample' && studio.shown[0].passes > 0", 'a run with the mode "sample"');
    await browser.until("document.getElementById('denoise-spread').hidden", 'which needs no hint');
    check(await browser.evaluate("studio.shown[0].view === 'denoised' && studio.runs.get(2).integrator === studio.runs.get(1).integrator"), 'it has the same method, and is denoised, too');

    // The last image of a run that ends.
    await browser.evaluate(post({action: 'stop', run: 1}));
    await browser.evaluate(post({action: 'stop', run: 2}));
    await browser.until("studio.runs.get(2).state === 'stopped' && studio.shown[0].passes === studio.runs.get(2).passes", 'the last image is denoised');

    // Values, differences and pictures.
    await browser.evaluate('studio.view.moveCursor(20, 30)');
    const pixel = "document.getElementById('pixel').textContent";
    await browser.until(`${pixel}.includes('denoised, not unbiased') && ${pixel}.includes('upper bound')`, 'the values of both images');
    await browser.evaluate(choose('against', '1'));
    await browser.until('studio.view.pictures[1]', 'the noisy image of another run beside it');
    await browser.evaluate("[...document.querySelectorAll('#view-tools button')].find(b => b.textContent === 'Measure').click()");
    await browser.until("document.querySelector('#view-tools > output').textContent.includes('run 2 denoised')", 'the difference names what is denoised');
    await browser.screenshot('denoise-3-beside');
    const name = await browser.evaluate(`(async () => {
        const {click} = HTMLAnchorElement.prototype;
        const clicked = new Promise(done => { HTMLAnchorElement.prototype.click = function() { done(this.download); }; });
        document.getElementById('save-picture').click();
        const name = await clicked;
        HTMLAnchorElement.prototype.click = click;
        return name;
    })()`);
    check(name.endsWith('.denoised.png'), `a picture of it is named so: ${name}`);
    const text = await browser.evaluate("studio.server.get('/v1/difference?run=1&against=denoised:2').then(() => '', e => e.message)");
    check(text.includes('biased'), `it is no reference: ${text}`);

    // Off again, by a key.
    await browser.evaluate(choose('against', '0'));
    await browser.evaluate("document.getElementById('view').focus()");
    await key(browser, 'd');
    await browser.until(`studio.shown[0].view === 'image' && !${label}.includes('denoised')`, 'the image with its noise');
    await browser.settle();
    check(differs(denoised, await pixels(browser, 'view')), 'which looks different');
    await browser.evaluate(press('denoise'));
    await browser.until("studio.shown[0].view === 'denoised' && studio.shown[0].passes > 0", 'denoised at once');
    await browser.evaluate(post({action: 'remove', run: 2}));
    await browser.until("studio.runs.size === 1 && studio.shown[0].run === 1 && studio.shown[0].passes > 0", 'a run that is removed is shown no longer');
    await checkNames(browser, 'the switch');
}

async function missingPart(browser) {
    await browser.until('studio.shown[0].passes >= 2', 'a rendering');
    await browser.evaluate(press('denoise'));
    const text = "document.getElementById('banner-text').textContent";
    await browser.until(`${text}.includes('pip install pyoidn')`, 'how to get the library');
    await browser.screenshot('denoise-4-missing');
    await browser.until("!document.getElementById('denoise').checked && studio.shown[0].view === 'image' && studio.shown[0].passes > 0", 'the switch is off again');
}

function part(library, use) {
    return async () => {
        process.env.ETENDUE_OIDN = library;
        const studio = await Studio.start(file, '-i', 'path', ...size);
        const browser = openBrowser();
        try {
            await browser.open(studio.url);
            await use(browser);
            const complaints = browser.complaints.filter(c => !c.includes('422'));
            check(complaints.length === 0, `the console is quiet: ${complaints.join('; ')}`);
        } finally {
            browser.close();
            check(await studio.stop() === 0, 'the program ends');
        }
    };
}

const library = process.env.ETENDUE_FAKE_DENOISER;
if (!library) console.log('skipped: ETENDUE_FAKE_DENOISER names no library');
await runParts(...(library ? [part(library, switchPart)] : []), part(join(folder, 'none.so'), missingPart));
