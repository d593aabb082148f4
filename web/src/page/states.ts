// Never by colour alone: a symbol and a word go with each state.

export interface StateLook {
  name: string;
  symbol: string;
  word: string;
  headline?: string; // of a whole answer, where it differs from that of one check
}
const looks: StateLook[] = [
  {name: 'good', symbol: '●', word: 'Good'},
  {name: 'care', symbol: '◆', word: 'Usable with care'},
  {name: 'bad', symbol: '▲', word: 'Bad', headline: 'Not to be trusted'}, // exit code 6
  {name: 'refused', symbol: '■', word: 'Refused'},
  {name: 'not_converged', symbol: '✕', word: 'Not converged'},
];
export function lookOf(state: string): StateLook {
  return looks.find((look) => look.name === state) ?? {name: 'unknown', symbol: '○', word: 'No verdict'};
}
