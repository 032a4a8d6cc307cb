#include "studio/server.h"

#include <algorithm>
#include <atomic>
#include <stdexcept>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/chunk_encode.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/http/write.hpp>

namespace etendue {
namespace {

namespace net = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using tcp = net::ip::tcp;
using boost::system::error_code;
using Parser = http::request_parser<http::string_body>;

constexpr auto kTimeout = std::chrono::milliseconds(int64_t(1000 * Server::kTimeout));
constexpr auto kEventInterval = std::chrono::milliseconds(100);
constexpr int kHeartbeat = 50;  ///< Event intervals.

std::string text(beast::string_view s) {
    return {s.data(), s.size()};
}

void set_limits(Parser& parser) {
    parser.header_limit(kMostHeaderBytes);
    parser.body_limit(kMostBodyBytes);
}

Request request_of(Parser& parser) {
    http::request<http::string_body>& m = parser.get();
    return {.method = text(m.method_string()),
            .target = text(m.target()),
            .host = text(m[http::field::host]),
            .origin = text(m[http::field::origin]),
            .fetch_site = text(m["Sec-Fetch-Site"]),
            .authorization = text(m[http::field::authorization]),
            .if_match = text(m[http::field::if_match]),
            .body = std::move(m.body()),
            .local_address = {}};
}

Reply refusal_of(const error_code& error) {
    if (error == http::error::body_limit) return Reply::error(413, "the body is larger than 1 MiB");
    if (error == http::error::header_limit || error == http::error::buffer_overflow)
        return Reply::error(431, "the header is larger than 8 KiB");
    return Reply::error(400, "this is no HTTP request");
}

/// Sent with every reply.
void set_common_fields(http::response<http::empty_body>& m) {
    m.set("Content-Security-Policy",
          "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
          "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'");
    m.set("X-Content-Type-Options", "nosniff");
    m.set("Referrer-Policy", "no-referrer");
    m.set("Cross-Origin-Resource-Policy", "same-origin");
    m.set(http::field::cache_control, "no-store");
}

}  // namespace

struct Server::Impl {
    // Connections, which `io` keeps alive, count themselves.
    // Threads of the workers may be the last to drop a connection.
    std::atomic<int> connections = 0, event_streams = 0;
    Handler* handler = nullptr;
    std::string address;
    net::io_context io{1};
    tcp::acceptor acceptor{io};
    std::thread thread;

    void accept();
};

namespace {

/// One connection: requests are answered one after the other.
class Connection : public std::enable_shared_from_this<Connection> {
public:
    template <class Impl>
    Connection(tcp::socket socket, Impl& server)
        : stream_(std::move(socket)), timer_(stream_.get_executor()), handler_(*server.handler),
          connections_(server.connections), event_streams_(server.event_streams) {
        ++connections_;
        error_code ignored;
        stream_.socket().set_option(tcp::no_delay(true), ignored);
        local_address_ = stream_.socket().local_endpoint(ignored).address().to_string();
    }
    ~Connection() {
        --connections_;
        if (is_event_stream_) --event_streams_;
    }

    void read() {
        parser_.emplace();
        set_limits(*parser_);
        stream_.expires_after(kTimeout);
        http::async_read(
            stream_, buffer_, *parser_,
            [self = shared_from_this()](const error_code& error, size_t) { self->on_read(error); });
    }

    void refuse(Reply reply) {
        keep_alive_ = false;
        write(std::move(reply));
    }

private:
    void on_read(const error_code& error) {
        if (error == http::error::end_of_stream || error == beast::error::timeout) return close();
        if (error) {
            // Errors of the connection itself cannot be answered.
            if (error.category() != http::make_error_code(http::error::bad_method).category())
                return;
            return refuse(refusal_of(error));
        }
        keep_alive_ = parser_->get().keep_alive();
        is_head_ = parser_->get().method() == http::verb::head;
        Request request = request_of(*parser_);
        request.local_address = local_address_;
        std::optional<Reply> refused;
        if (handler_.is_events(request, refused)) {
            if (event_streams_ < Server::kMostEventStreams) return stream_events();
            refused = Reply::error(429, fmt::format("{} pages are open already; close one",
                                                    Server::kMostEventStreams));
        }
        if (refused) return write(std::move(*refused));
        stream_.expires_never();
        handler_.handle(
            request, [self = shared_from_this(), executor = stream_.get_executor()](Reply reply) {
                net::post(executor, [self, reply = std::move(reply)]() mutable {
                    self->write(std::move(reply));
                });
            });
    }

    void write(Reply reply) {
        body_ = std::move(reply.body);
        written_ = 0;
        header_ = {};
        header_.version(11);
        header_.result(unsigned(reply.status));
        set_common_fields(header_);
        if (reply.status != 204) header_.set(http::field::content_type, reply.type);
        if (!reply.etag.empty()) header_.set(http::field::etag, reply.etag);
        if (reply.status == 401) header_.set(http::field::www_authenticate, "Bearer");
        header_.keep_alive(keep_alive_);
        if (reply.status != 204) header_.content_length(body_.size());
        write_header([self = shared_from_this()] { self->write_body(); });
    }

    template <class Next>
    void write_header(Next next) {
        serializer_.emplace(header_);
        stream_.expires_after(kTimeout);
        http::async_write_header(
            stream_, *serializer_,
            [self = shared_from_this(), next = std::move(next)](const error_code& error, size_t) {
                if (!error) next();
            });
    }

    /// In pieces, each with its own time limit.
    void write_body() {
        constexpr size_t kPiece = 256 << 10;
        if (is_head_ || written_ == body_.size()) {
            if (keep_alive_) return read();
            return linger();
        }
        const size_t size = std::min(kPiece, body_.size() - written_);
        stream_.expires_after(kTimeout);
        net::async_write(stream_, net::buffer(body_.data() + written_, size),
                         [self = shared_from_this(), size](const error_code& error, size_t) {
                             if (error) return;
                             self->written_ += size;
                             self->write_body();
                         });
    }

    /// Reads what the client still sends, for a short time: closing earlier could lose the reply on its way.
    void linger() {
        error_code ignored;
        stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
        stream_.expires_after(std::chrono::seconds(2));
        discard();
    }
    void discard() {
        scratch_.resize(64 << 10);
        stream_.async_read_some(net::buffer(scratch_),
                                [self = shared_from_this()](const error_code& error, size_t size) {
                                    constexpr size_t kMost = 16 << 20;
                                    self->discarded_ += size;
                                    if (!error && self->discarded_ < kMost) self->discard();
                                });
    }
    void close() {
        error_code ignored;
        stream_.socket().shutdown(tcp::socket::shutdown_both, ignored);
    }

    // -- Events.

    void stream_events() {
        is_event_stream_ = true;
        ++event_streams_;
        header_ = {};
        header_.version(11);
        header_.result(http::status::ok);
        set_common_fields(header_);
        header_.set(http::field::content_type, "application/x-ndjson");
        header_.chunked(true);
        write_header([self = shared_from_this()] { self->watch_for_end(), self->send_event(); });
    }
    /// A client that closes its page is noticed at once.
    void watch_for_end() {
        scratch_.resize(1024);
        stream_.socket().async_read_some(
            net::buffer(scratch_), [self = shared_from_this()](const error_code& error, size_t) {
                if (!error) return self->watch_for_end();
                self->is_ended_ = true;
                self->timer_.cancel();
            });
    }
    void send_event() {
        if (is_ended_) return;
        const uint64_t revision = handler_.revision();
        if (revision == seen_ && ++idle_ < kHeartbeat) return wait();
        seen_ = revision;
        idle_ = 0;
        body_ = handler_.event() + "\n";
        stream_.expires_after(kTimeout);
        net::async_write(stream_, http::make_chunk(net::buffer(body_)),
                         [self = shared_from_this()](const error_code& error, size_t) {
                             if (!error) return self->wait();
                             self->close();
                         });
    }
    void wait() {
        stream_.expires_never();
        timer_.expires_after(kEventInterval);
        timer_.async_wait([self = shared_from_this()](const error_code& error) {
            if (!error) self->send_event();
        });
    }

    beast::tcp_stream stream_;
    net::steady_timer timer_;
    Handler& handler_;
    std::atomic<int>& connections_;
    std::atomic<int>& event_streams_;
    std::string local_address_;
    beast::flat_buffer buffer_{kMostHeaderBytes + kMostBodyBytes};
    std::optional<Parser> parser_;
    http::response<http::empty_body> header_;
    std::optional<http::response_serializer<http::empty_body>> serializer_;
    std::string body_;
    std::vector<char> scratch_;
    size_t written_ = 0, discarded_ = 0;
    bool keep_alive_ = false, is_head_ = false, is_event_stream_ = false, is_ended_ = false;
    uint64_t seen_ = 0;
    int idle_ = 0;
};

}  // namespace

void Server::Impl::accept() {
    acceptor.async_accept([this](const error_code& error, tcp::socket socket) {
        if (error == net::error::operation_aborted) return;
        if (!error) {
            const bool is_full = connections >= kMostConnections;
            const auto connection = std::make_shared<Connection>(std::move(socket), *this);
            if (is_full)
                connection->refuse(Reply::error(503, "there are too many connections"));
            else
                connection->read();
        }
        accept();
    });
}

Server::Server(const std::string& address, int port) : impl_(std::make_unique<Impl>()) {
    impl_->address = address;
    try {
        const tcp::endpoint endpoint(net::ip::make_address(address), uint16_t(port));
        impl_->acceptor.open(endpoint.protocol());
        impl_->acceptor.set_option(net::socket_base::reuse_address(true));
        impl_->acceptor.bind(endpoint);
        impl_->acceptor.listen();
    } catch (const boost::system::system_error& e) {
        throw std::runtime_error(
            fmt::format("cannot listen at {}, port {}: {}", address, port, e.code().message()));
    }
}

Server::~Server() {
    stop();
}

int Server::port() const {
    return impl_->acceptor.local_endpoint().port();
}

std::string Server::url() const {
    // The brackets of IPv6 addresses keep their colons apart from that of the port.
    const bool has_colons = impl_->address.find(':') != std::string::npos;
    return "http://" + (has_colons ? "[" + impl_->address + "]" : impl_->address) + ":" +
           std::to_string(port());
}

void Server::start(Handler& handler) {
    impl_->handler = &handler;
    impl_->accept();
    impl_->thread = std::thread([this] { impl_->io.run(); });
}

void Server::stop() {
    impl_->io.stop();
    if (impl_->thread.joinable()) impl_->thread.join();
}

ParsedRequest parse_request(std::string_view bytes) {
    Parser parser;
    set_limits(parser);
    parser.eager(true);
    error_code error;
    parser.put(net::buffer(bytes.data(), bytes.size()), error);
    if (!error && !parser.is_done()) parser.put_eof(error);
    if (error) return {{}, refusal_of(error)};
    return {request_of(parser), {}};
}

}  // namespace etendue
