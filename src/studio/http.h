#pragma once
// Requests and replies without sockets.

#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

namespace etendue {

/// The largest header and body of a request that are read.
inline constexpr size_t kMostHeaderBytes = 8 << 10, kMostBodyBytes = 1 << 20;
/// The largest body of a request that brings a file, and the bodies of all such requests at a time.
inline constexpr size_t kMostFileBytes = 512 << 20, kMostFileBytesAtATime = 2 * kMostFileBytes;

struct Request {
    std::string method, target;
    /// Header fields; empty where absent.
    std::string host, origin, fetch_site, authorization, if_match;
    std::string body;
    std::string local_address;  ///< To which the connection was made, without port.

    std::string_view path() const { return std::string_view(target).substr(0, target.find('?')); }
    /// The value of a query parameter, decoded; empty where it is absent or given twice.
    std::optional<std::string> query(std::string_view name) const;
};

struct Reply {
    int status = 200;
    std::string type = "application/json";
    std::string body;
    std::string etag;  ///< Empty if there is none.
    /// The body instead of `body`, where other replies have the same.
    std::shared_ptr<const std::string> shared_body;

    static Reply json(std::string text) {
        Reply reply;
        reply.body = std::move(text);
        return reply;
    }
    static Reply binary(std::string bytes) {
        Reply reply = json(std::move(bytes));
        reply.type = "application/octet-stream";
        return reply;
    }
    static Reply nothing() {
        Reply reply;
        reply.status = 204;
        return reply;
    }
    /// {"error": message}
    static Reply error(int status, std::string_view message);
    /// The error of the exception that is being handled.
    static Reply current_exception();
};

/// A request that cannot be carried out.
struct ApiError : std::runtime_error {
    ApiError(int status, const std::string& message)
        : std::runtime_error(message), status(status) {}
    int status;
};

/// Who asks, and for what.
struct Admission {
    std::optional<Reply> refusal;  ///< If the request is rejected.
    bool has_token = false;
    bool is_events = false;    ///< The reply is a stream of events.
    bool brings_file = false;  ///< Its body may have kMostFileBytes.
};

/// The interface between server and application. The server's thread calls all functions except `done`.
class Handler {
public:
    virtual ~Handler() = default;
    virtual Admission admit(const Request& request) = 0;
    /// Calls `done` once, from any thread. If `done` is never called, for which memory may be missing, the connection is
    /// closed with its last copy.
    virtual void handle(Request request, std::function<void(Reply)> done) = 0;
    /// Changes with the next event.
    virtual uint64_t revision() = 0;
    /// One line of JSON, without its end.
    virtual std::string event() = 0;
};

}  // namespace etendue
