/* The numbers of a curve from their differences; see curves.py. */
function decoded(code) {
  let sum = 0;
  return code.d.map(step => {
    if (step === null) return null;
    sum += step;
    return code.log ? 10 ** (sum * code.s) : sum * code.s;
  });
}
