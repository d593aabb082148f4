// The run that is going on, over a WebSocket in the Foxglove protocol.
import FoxgloveClient from '@foxglove/ws-protocol/dist/esm/src/FoxgloveClient';

export type Message = Record<string, unknown>;
export interface Listener {
  message(topic: string, message: Message): void;
  status(level: number, words: string): void;
  opened(): void; // also after a silence
  silent(): void;
  closed(): void;
}

const names = ['foxglove.sdk.v1', FoxgloveClient.SUPPORTED_SUBPROTOCOL];
const look_ms = 200, maxSilent = 9; // looks without a word: the server tells the time once a second

/** Subscribes to everything. `close` ends it without a word to the listener. */
export function connect(listener: Listener): {close: () => void} {
  const address = `${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/${location.search}`;
  const client = new FoxgloveClient({ws: new WebSocket(address, names)}), topics = new Map<number, string>(), decoder = new TextDecoder();
  let silent = -1, isOver = false; // -1: nothing was heard yet
  const lost = () => {
    if (isOver) return;
    isOver = true;
    clearInterval(watch);
    listener.closed();
  };
  // A machine that is gone closes nothing. Looks are counted, not time: a page that was busy has not listened.
  const watch = setInterval(() => silent >= 0 && ++silent === maxSilent && listener.silent(), look_ms);
  client.on('advertise', (channels) => {
    for (const channel of channels) topics.set(client.subscribe(channel.id), channel.topic);
    listener.opened();
  });
  client.on('message', (event) => {
    if (isOver) return;
    listener.message(topics.get(event.subscriptionId) ?? '', JSON.parse(decoder.decode(event.data)) as Message);
  });
  client.on('time', () => {
    if (silent >= maxSilent) listener.opened();
    silent = 0;
  });
  client.on('status', (event) => listener.status(event.level, event.message));
  client.on('close', lost);
  client.on('error', () => undefined); // close follows
  return {close: () => {
    isOver = true;
    clearInterval(watch);
    client.close();
  }};
}
