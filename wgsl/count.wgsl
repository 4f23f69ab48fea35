// Accepted fragments. One word: 2^32 fragments on a pixel are more than a render can hold surfels.

override COUNT_WORD: u32;
override COUNT_IMAGE: u32;

fn accumulate_count(word: u32) {
    atomicAdd(&sums[word + COUNT_WORD], 1u);
}

fn write_count(out: u32, word: u32) {
    image[out + COUNT_IMAGE] = f32(atomicLoad(&sums[word + COUNT_WORD]));
}
