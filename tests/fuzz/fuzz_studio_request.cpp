// Any bytes as a request to the studio: read, judged, and its address taken apart.

#include "studio/guard.h"
#include "studio/server.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace etendue;
    ParsedRequest parsed = parse_request({reinterpret_cast<const char*>(data), size});
    if (parsed.request.has_value() == parsed.refusal.has_value()) __builtin_trap();
    if (!parsed.request) return 0;
    Request& request = *parsed.request;
    request.local_address = "127.0.0.1";
    // The token is longer than what the fuzzer can guess.
    const auto refused = refuse(request, "0123456789abcdef0123456789abcdef");
    if (!refused && request.path().starts_with("/v1")) __builtin_trap();
    for (const char* name : {"run", "view", "file"})
        if (const auto value = request.query(name); value && is_file_name(*value))
            for (const char c : *value)
                if (c == '/' || c == '\0') __builtin_trap();
    if (request.body.size() > kMostBodyBytes) __builtin_trap();
    return 0;
}
