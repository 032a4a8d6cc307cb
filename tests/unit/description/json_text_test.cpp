// JSON of files and requests: what is refused, and where the message says it stands.

#include "description/json_text.h"

#include "expect_scene_error.h"

namespace etendue {
namespace {

std::string nested(size_t depth, const char* inner = "1") {
    return std::string(depth, '[') + inner + std::string(depth, ']');
}

TEST(Json, IsReadUpToItsDepth) {
    EXPECT_EQ(parse_json("\xef\xbb\xbf{\"a\": [1, \"[[\\\"[[\"]}", "f")["a"][0], 1);
    const std::string deep = nested(kDeepestJson);
    EXPECT_EQ(parse_json(deep, "f").dump(), deep);
    expect_scene_error(1, "nested more than 64 deep",
                       [] { parse_json(nested(kDeepestJson + 1), "f"); });
    expect_scene_error(2, "nested more than 64 deep",
                       [] { parse_json("{\"a\":\n" + std::string(1'000'000, '['), "f"); });
    expect_scene_error(1, "nested more than 64 deep", [] {
        std::string objects;
        for (int i = 0; i < 100; ++i) objects += "{\"a\":";
        parse_json(objects, "f");
    });
}

TEST(Json, ErrorsNameTheLine) {
    expect_scene_error(2, "malformed JSON", [] { parse_json("[1,\n2,,\n3]", "f"); });
    expect_scene_error(3, "the text ends early", [] { parse_json("[1,\n2\n", "f"); });
    expect_scene_error(1, "the text ends early", [] { parse_json("", "f"); });
    expect_scene_error(2, "the number 1e999 is too large", [] { parse_json("[1,\n1e999]", "f"); });
    expect_scene_error(0, "UTF-16", [] { parse_json(std::string("\xff\xfe[\0]\0", 6), "f"); });
    expect_scene_error(0, "UTF-16", [] { parse_json(std::string("\0[\0]", 4), "f"); });
    expect_scene_error(1, "malformed JSON", [] { parse_json("[\"\xff\"]", "f"); });
}

TEST(Json, MessagesShowTheBeginningOfAValue) {
    EXPECT_EQ(excerpt(nlohmann::json{1, "two"}), "[1,\"two\"]");
    const std::string text = excerpt(std::string(1000, 'x'));
    EXPECT_LT(text.size(), 70u);
    EXPECT_TRUE(text.ends_with("..."));
}

}  // namespace
}  // namespace etendue
