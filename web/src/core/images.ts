// Images stand in the page as inert blocks; one becomes an image when it is first looked at.

const blocks = new Map<string, HTMLElement>();
const images = new Map<string, HTMLImageElement>();
const waiting = new Map<string, (() => void)[]>();
const arrived: (() => void)[] = [];
let isComplete = false;

/** The blocks stand behind the script: they are found once the page has been read. */
export function findImages(): void {
  for (const block of document.querySelectorAll<HTMLElement>('script[type="text/plain"][id^="image-"]'))
    blocks.set(block.dataset['name'] ?? '', block);
  isComplete = true;
  for (const listener of arrived.splice(0)) listener();
}
export function whenImagesAreHere(listener: () => void): void {
  if (isComplete) listener();
  else arrived.push(listener);
}
export function hasImage(name: string): boolean {
  return blocks.has(name);
}
export function imageNames(): string[] {
  return [...blocks.keys()];
}

/** The image, or null until it is there; `ready` is called then. */
export function imageOf(name: string, ready: () => void): HTMLImageElement | null {
  const block = blocks.get(name);
  if (!block) return null;
  let image = images.get(name);
  if (!image) {
    image = new Image();
    images.set(name, image);
    waiting.set(name, []);
    image.onload = () => {
      for (const listener of waiting.get(name) ?? []) listener();
      waiting.delete(name);
    };
    image.src = `data:image/jpeg;base64,${(block.textContent ?? '').trim()}`;
  }
  if (image.complete && image.naturalWidth > 0) return image;
  waiting.get(name)?.push(ready);
  return null;
}
