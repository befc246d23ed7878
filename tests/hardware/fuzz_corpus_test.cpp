// The fuzzers' corpora as regression tests, in every build.
#include "tests/fuzz/corpus.h"
#include "tests/fuzz/frame_decoder_properties.h"
#include "tests/fuzz/journal_properties.h"
#include "tests/fuzz/marlin_reply_properties.h"
#include "tests/support/test.h"

namespace supertac::fuzz_corpus_test {

TEST(FuzzCorpus, FrameDecoder) { EXPECT_GE(replay("frame_decoder", check_frame_decoder), 62); }

TEST(FuzzCorpus, MarlinReplies) { EXPECT_GE(replay("marlin_reply", check_marlin_replies), 40); }

TEST(FuzzCorpus, Journals) { EXPECT_GE(replay("journal", check_journal), 26); }

}  // namespace supertac::fuzz_corpus_test
