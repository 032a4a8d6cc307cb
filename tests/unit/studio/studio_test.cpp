// Requests, names of files and images of the studio, without sockets; and the reader of requests.

#include <cmath>
#include <limits>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "image/image.h"
#include "image_body.h"
#include "studio/guard.h"
#include "studio/image_reply.h"
#include "studio/pixel_values.h"
#include "studio/server.h"

namespace etendue::test {
namespace {

Request good_request() {
    return {.method = "GET",
            .target = "/v1/state",
            .host = "127.0.0.1:80",
            .origin = {},
            .fetch_site = {},
            .authorization = "Bearer secret",
            .if_match = {},
            .body = {},
            .local_address = "127.0.0.1"};
}
int status(const Request& r) {
    const auto refused = refuse(r, "secret");
    return refused ? refused->status : 200;
}

TEST(Refuse, LetsTheOwnPagePass) {
    Request r = good_request();
    EXPECT_EQ(status(r), 200);
    r.origin = "http://127.0.0.1:80";
    r.fetch_site = "same-origin";
    EXPECT_EQ(status(r), 200);
    r.host = "[::1]:99", r.local_address = "::1", r.origin = {};
    EXPECT_EQ(status(r), 200);
}

TEST(Refuse, OthersAndWrongTokens) {
    for (const char* token : {"", "Bearer ", "Bearer secreT", "bearer secret", "secret",
                              "Bearer secret ", "Bearer secretsecret"}) {
        Request r = good_request();
        r.authorization = token;
        EXPECT_EQ(status(r), 401) << token;
    }
    for (const char* host : {"", "evil", "127.0.0.1.evil", "[127.0.0.1", "[::1]x", "0.0.0.0"}) {
        Request r = good_request();
        r.host = host;
        EXPECT_EQ(status(r), 403) << host;
        r.target = "/";
        EXPECT_EQ(status(r), 403) << host;
    }
}

TEST(Tokens, Have128BitsAndDiffer) {
    const std::string a = make_token(), b = make_token();
    EXPECT_EQ(a.size(), 32u);
    EXPECT_NE(a, b);
}

TEST(FileNames, AreSimple) {
    for (const char* good : {"a", "picture.exr", "A_b-c.1"}) EXPECT_TRUE(is_file_name(good));
    for (const std::string bad : {"", ".", "..", ".a", "a/b", "a\\b", "a b", "ä", "a\n", "%41"})
        EXPECT_FALSE(is_file_name(bad)) << bad;
    EXPECT_FALSE(is_file_name(std::string(129, 'a')));
    EXPECT_FALSE(is_file_name(std::string("a\0b", 3)));
}

TEST(Queries, AreDecodedOnce) {
    Request r = good_request();
    r.target = "/v1/image?view=length%3a2&run=3&twice=1&twice=2&bad=%4&worse=%zz&empty=&alone";
    EXPECT_EQ(r.path(), "/v1/image");
    EXPECT_EQ(r.query("view"), "length:2");
    EXPECT_EQ(r.query("run"), "3");
    EXPECT_EQ(r.query("empty"), "");
    for (const char* none : {"twice", "bad", "worse", "alone", "missing", "un"})
        EXPECT_FALSE(r.query(none)) << none;
}

TEST(Requests, AreReadWithinLimits) {
    const auto read = [](const std::string& text) { return parse_request(text); };
    const ParsedRequest good = read("PUT /v1/paths?file=a HTTP/1.1\r\nHost: h\r\nOrigin: o\r\n"
                                    "Sec-Fetch-Site: s\r\nAuthorization: t\r\nIf-Match: e\r\n"
                                    "Content-Length: 2\r\n\r\n[]");
    ASSERT_TRUE(good.request);
    EXPECT_EQ(good.request->method, "PUT");
    EXPECT_EQ(good.request->host + good.request->origin + good.request->fetch_site +
                  good.request->authorization + good.request->if_match + good.request->body,
              "hoste[]");
    const auto refused = [&](const std::string& text) {
        const ParsedRequest r = read(text);
        return r.refusal ? r.refusal->status : 200;
    };
    EXPECT_EQ(refused("GET / HTTP/1.1\r\nX: " + std::string(9000, 'x') + "\r\n\r\n"), 431);
    EXPECT_EQ(refused("POST / HTTP/1.1\r\nContent-Length: 1048577\r\n\r\n"), 413);
    EXPECT_EQ(refused("POST / HTTP/1.1\r\nContent-Length: -1\r\n\r\n"), 400);
    EXPECT_EQ(refused("POST / HTTP/1.1\r\nContent-Length: 9\r\n\r\n[]"), 400);
    EXPECT_EQ(refused("GET / HTTP/1.1\r\nHost: a"), 400);
    EXPECT_EQ(refused(""), 400);
}

TEST(RectangleValues, LeaveOutPixelsThatAreNotFinite) {
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN(),
                    kInfinite = std::numeric_limits<float>::infinity();
    Snapshot s;
    s.width = 4, s.height = 2;
    s.mean = {Rgb(99), Rgb(1, 2, 4), Rgb(kInfinite, 0, 0), Rgb(99),
              Rgb(99), Rgb(3, 2, 8), Rgb(0, kNan, kNan),   Rgb(99)};
    s.variance = std::vector<Rgb>(8, Rgb(0.5f));
    const RectangleValues v = values_in(s, {.x = 1, .y = 0, .width = 2, .height = 2});
    EXPECT_EQ(v.finite, 2);
    EXPECT_EQ(v.nan, 1);
    EXPECT_EQ(v.infinite, 1);
    EXPECT_EQ(v.mean, (RectangleValues::Channels{2, 2, 6}));
    EXPECT_EQ(v.least, (RectangleValues::Channels{1, 2, 4}));
    EXPECT_EQ(v.largest, (RectangleValues::Channels{3, 2, 8}));
    EXPECT_EQ(v.variance, (RectangleValues::Channels{2, 0, 8}));
    EXPECT_EQ(v.squared_error, (RectangleValues::Channels{0.25, 0.25, 0.25}));
}

TEST(Images, KeepRectanglesLevelsAndLargeValues) {
    std::vector<Rgb> pixels;
    for (int i = 0; i < 15; ++i) pixels.push_back(Rgb(float(i), 1, 1e6f));
    const PixelRows<Rgb> rows(pixels, 5, 3);
    ImagePart part{.run = 7, .passes = 3, .rect = ImageRect{1, 1, 3, 2}, .level = 0};
    const std::string whole = encode_image(part, rows);
    EXPECT_EQ(whole.size(), 64 + 3 * 2 * 3 * 2u);
    EXPECT_EQ(whole.substr(0, 4), "ETND");
    EXPECT_EQ(field_at(whole, 1), 7u);
    EXPECT_EQ(field_at(whole, 2), 3u);
    const float scale = std::ldexp(1.0f, int(field_at(whole, 9)));
    EXPECT_GT(scale, 1);
    EXPECT_EQ(half_at(whole, 0) * scale, 6);
    EXPECT_NEAR(half_at(whole, 2) * scale, 1e6f, 1e3f);
    part.level = 1;
    const std::string coarse = encode_image(part, rows);
    EXPECT_EQ(coarse.size(), 64 + 2 * 1 * 3 * 2u);
    EXPECT_NEAR(half_at(coarse, 0) * scale, (6 + 7 + 11 + 12) / 4.0f, 0.01f);
    EXPECT_NEAR(half_at(coarse, 3) * scale, (8 + 13) / 2.0f, 0.01f);
    for (const ImageRect bad :
         {ImageRect{-1, 0, 1, 1}, ImageRect{0, 0, 6, 1}, ImageRect{4, 2, 2, 1},
          ImageRect{0, 0, 0, 1}, ImageRect{1, 1, 2147483647, 1}}) {
        part.rect = bad;
        EXPECT_THROW(encode_image(part, rows), std::runtime_error);
    }
    for (const int level : {-1, 9})
        EXPECT_THROW(encode_image({.run = 0, .passes = 0, .rect = {}, .level = level}, rows),
                     std::runtime_error);
    for (const auto& [width, height] : {std::pair{5, 4}, {4, 3}, {15, 2}, {-5, -3}})
        EXPECT_THROW(PixelRows<Rgb>(pixels, width, height), std::logic_error);
}

TEST(Images, KeepDigitsOfSmallValues) {
    for (const float largest : {1e-3f, 1e-9f, 1e-30f, 1e-37f, 1.0f, 65504.0f, 1e30f}) {
        const std::vector<Rgb> pixels{Rgb(largest), Rgb(0.3f * largest), Rgb(-1e-3f * largest),
                                      Rgb(0)};
        const std::string body = encode_image({}, PixelRows<Rgb>(pixels, 2, 2));
        for (size_t i = 0; i < 4; ++i)
            EXPECT_NEAR(std::ldexp(half_at(body, 3 * i), int32_t(field_at(body, 9))), pixels[i].r,
                        1e-3f * std::abs(pixels[i].r));
    }
    const std::vector<float> none(1);
    EXPECT_EQ(half_at(encode_image({}, PixelRows<float>(none, 1, 1)), 0), 0);
}

TEST(RelativeErrors, OfOneChannelAndOfThree) {
    Snapshot s;
    s.width = 2, s.height = 1;
    s.mean = {Rgb(1), Rgb(1)};
    s.variance = {Rgb(0.04f), Rgb(0.04f, 0, 0)};
    const std::vector<float> errors = relative_errors(s);
    EXPECT_NEAR(errors[0], 0.2f, 1e-6f);
    EXPECT_NEAR(errors[1], luminance(Rgb(0.2f, 0, 0)), 1e-6f);
    // A pixel that is not finite changes no other.
    for (const float bad : {std::numeric_limits<float>::infinity(), std::nanf("")}) {
        s.width = 3;
        s.mean = {Rgb(1), Rgb(0), Rgb(bad)};
        s.variance.assign(3, Rgb(0.04f));
        const std::vector<float> others = relative_errors(s);
        EXPECT_NEAR(others[0], 0.2f, 1e-6f);
        EXPECT_NEAR(others[1], 0.2f / (0.1f / 3), 1e-4f);
    }
}

}  // namespace
}  // namespace etendue::test
