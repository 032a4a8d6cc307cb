// Any bytes as a request to the studio: read, judged, and its address taken apart. The body is read as that of every kind
// of request.

#include "fuzz_target.h"
#include "studio/guard.h"
#include "studio/request_values.h"
#include "studio/server.h"

namespace etendue::fuzz {
namespace {

/// Reads a value; a refusal is no defect.
template <class Read>
void attempt(const Read& read) {
    try {
        read();
    } catch (const ApiError&) {
    }
}

void read_values(const Request& request) {
    for (const char* name : {"run", "width", "length"})
        attempt([&] { query_integer(request, name, 0); });
    attempt([&] { paths_of(parse_body(request.body), "paths.json"); });
    attempt([&] {
        const nlohmann::json body = parse_object(request.body);
        attempt([&] { limits_of(body); });
        attempt([&] { paths_of(body.value("paths", nlohmann::json()), "paths"); });
        for (const char* name : {"x", "seed", "threads"})
            attempt([&] { integer(body, name, 0, INT64_MAX, 0); });
        for (const char* name : {"integrator", "sampler"}) attempt([&] { text_of(body, name); });
        attempt([&] { to_vec(body.value("origin", nlohmann::json()), "origin"); });
    });
}

void run(std::string_view bytes) {
    ParsedRequest parsed = parse_request(bytes);
    require(parsed.request.has_value() != parsed.refusal.has_value());
    if (!parsed.request) return;
    Request& request = *parsed.request;
    request.local_address = "127.0.0.1";
    // The token is longer than what the fuzzer can guess.
    const auto refused = refuse(request, "0123456789abcdef0123456789abcdef");
    require(refused || !request.path().starts_with("/v1"));
    for (const char* name : {"run", "view", "file"})
        if (const auto value = request.query(name); value && is_file_name(*value))
            for (const char c : *value) require(c != '/' && c != '\0');
    require(request.body.size() <= kMostBodyBytes);
    read_values(request);
}

const Register kRegister({.name = "studio_request", .run = run});

}  // namespace
}  // namespace etendue::fuzz
